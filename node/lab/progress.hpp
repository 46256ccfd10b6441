// Progress display of a verb that takes long.
#pragma once
#include <cstdint>
#include <string>

namespace tactiled::ctl {

// A bar on standard error, when it takes over 2 s and a person is watching.
class Progress {
public:
    explicit Progress(std::string what);
    ~Progress();
    Progress(const Progress&) = delete;
    Progress& operator=(const Progress&) = delete;
    void show(double share);  // done, 0 .. 1

private:
    std::string what_;
    std::uint64_t began_ns_, shown_ns_ = 0;
    bool watched_;
};

}  // namespace tactiled::ctl
