// Files with faults: missing, forbidden, of a wrong kind, too large, unreadable, on a full disk.
// tests/system/save_test.py covers faults that only a failing system call shows.
#include "config/text_file.hpp"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>

#include "tests/unit/config/folder.hpp"

namespace tactiled {
namespace {

// Returns the reason why `path` is not read, without the path.
std::string why_not(const std::string& path, std::size_t max_bytes = 100) {
    Problems problems;
    EXPECT_EQ(read_text_file(path, max_bytes, problems), std::nullopt);
    const auto lines = problems.lines();
    EXPECT_EQ(lines.size(), 1u);
    if (lines.empty()) return "";
    const std::string head = (path.empty() ? "\"\"" : path) + ": ";
    EXPECT_EQ(lines.front().substr(0, head.size()), head);
    return lines.front().substr(head.size());
}

// Acts as a user without rights to read everything; root has them.
class SomeUser {
public:
    SomeUser() {
        if (was_ == 0) { EXPECT_EQ(::seteuid(65534), 0); }
    }
    ~SomeUser() { EXPECT_EQ(::seteuid(was_), 0); }

private:
    const uid_t was_ = ::geteuid();
};

class TextFile : public testing::Test {
protected:
    [[nodiscard]] std::vector<std::string> names() const {
        std::vector<std::string> all;
        for (const auto& entry : std::filesystem::directory_iterator(folder_.path())) all.push_back(entry.path().filename());
        return all;
    }
    // Returns the exception text of replace_file(); "" without an exception.
    static std::string thrown(const std::string& path, std::string_view bytes) {
        try {
            replace_file(path, bytes);
        } catch (const SaveError& error) { return error.what(); }
        return "";
    }
    const test::Folder folder_;
    const std::string path_ = folder_ / "a.toml";
};

TEST_F(TextFile, ThatCannotBeReadIsSaidWithItsReason) {
    EXPECT_EQ(why_not(""), "the path is empty; give the path of a file");
    EXPECT_EQ(why_not(path_), "there is no such file; give the path of one that exists");
    EXPECT_EQ(why_not("no-such.toml"), "there is no such file, seen from the folder " +
                                           std::filesystem::current_path().string() + "; give the path of one that exists");
    EXPECT_EQ(why_not(folder_.path()), "is a folder; give the path of a file in it");
    EXPECT_EQ(why_not("/dev/zero"), "is a pipe or a device; give the path of a regular file");
    ASSERT_EQ(::mkfifo(path_.c_str(), 0600), 0);
    EXPECT_EQ(why_not(path_), "is a pipe or a device; give the path of a regular file");  // and does not wait for a writer
    ASSERT_EQ(::symlink("loop", (folder_ / "loop").c_str()), 0);
    EXPECT_EQ(why_not(folder_ / "loop"), "cannot be opened: Too many levels of symbolic links");
    EXPECT_EQ(why_not("/proc/self/mem"), "cannot be read: Input/output error");  // its first page is not mapped
    const std::string mine = folder_.write("mine.toml", "a");
    ::chmod(folder_.path().c_str(), 0755);
    ::chmod(mine.c_str(), 0);
    const SomeUser user;
    EXPECT_EQ(why_not(mine), "user " + std::to_string(::geteuid()) + " may not read it; change its rights or its owner");
}

TEST_F(TextFile, IsReadToItsLimitAndNotBeyond) {
    const std::string large(200'000, 'x');  // several pieces
    Problems problems;
    EXPECT_EQ(read_text_file(folder_.write("large", large), large.size(), problems), large);
    EXPECT_EQ(why_not(folder_ / "large", large.size() - 1),
              "is larger than 199999 bytes; this is not the kind of file that is read here");
    EXPECT_FALSE(read_text_file("/proc/self/stat", 10'000, problems).value_or("").empty());  // its reported size is 0 bytes
    EXPECT_TRUE(problems.empty());
}

TEST_F(TextFile, OnAFullDiskTheOldOneStays) {
    replace_file(path_, "old");
    rlimit was{};
    ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &was), 0);
    const rlimit full{100'000, was.rlim_max};  // more than half of it is written, then the writes fail
    const auto handler = std::signal(SIGXFSZ, SIG_IGN);
    ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &full), 0);
    const std::string why = thrown(path_, std::string(150'000, 'n'));
    ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &was), 0);
    std::signal(SIGXFSZ, handler);
    EXPECT_EQ(why, path_ + ": not saved: write: File too large");
    EXPECT_EQ(test::read_file(path_), "old");
    EXPECT_EQ(names(), std::vector<std::string>{"a.toml"});
    EXPECT_EQ(thrown(path_, "new"), "");
    EXPECT_EQ(test::read_file(path_), "new");
}

TEST_F(TextFile, IsNotSavedWhereItCannotStand) {
    EXPECT_EQ(thrown(folder_ / "none/a.toml", "new"),
              (folder_ / "none/a.toml") + ": not saved: a file beside it cannot be made: No such file or directory");
    (void)std::filesystem::create_directory(path_);
    EXPECT_EQ(thrown(path_, "new"), path_ + ": not saved: rename: Is a directory");
    EXPECT_EQ(names(), std::vector<std::string>{"a.toml"});
    const auto here = std::filesystem::current_path();
    std::filesystem::current_path(folder_.path());
    EXPECT_EQ(thrown("plain.toml", "new"), "");
    std::filesystem::current_path(here);
    EXPECT_EQ(test::read_file(folder_ / "plain.toml"), "new");
}

TEST_F(TextFile, DoesNotReplaceAPipeOrADevice) {
    ASSERT_EQ(::mkfifo(path_.c_str(), 0600), 0);
    EXPECT_EQ(thrown(path_, "new"), path_ + ": not saved: it is a pipe or a device; give the path of a regular file");
    EXPECT_TRUE(std::filesystem::is_fifo(path_));
}

}  // namespace
}  // namespace tactiled
