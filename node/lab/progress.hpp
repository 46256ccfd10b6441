// Progress display of a verb that takes long.
#pragma once
#include <cstdint>
#include <string>

namespace tactiled::ctl {

// Shows a bar on standard error if the work takes over 2 s and standard error is a terminal.
class Progress {
public:
    explicit Progress(std::string what);
    ~Progress();
    Progress(const Progress&) = delete;
    Progress& operator=(const Progress&) = delete;
    void show(double share);  // share done, 0 .. 1

private:
    std::string what_;
    std::uint64_t began_ns_, shown_ns_ = 0;
    bool watched_;
};

}  // namespace tactiled::ctl
