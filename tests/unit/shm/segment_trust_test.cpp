// A forged segment is refused, and a truncated one ends no reader.
#include <sys/wait.h>

#include <filesystem>
#include <thread>

#include "segment_fixture.hpp"

namespace tactiled {
namespace {

constexpr uid_t kStranger = 65534;

// A separate folder inside the run-time folder.
class TrustTest : public SegmentTest {
protected:
    TrustTest() : folder_(runtime_folder() + "/" + name_) {
        std::filesystem::create_directory(folder_);
        path_ = folder_ + "/tactiled." + name_;
        set_runtime_folder(folder_);
    }
    ~TrustTest() override {
        ::unsetenv(TACTILED_FOLDER_VARIABLE);
        std::filesystem::remove_all(folder_);
    }
    std::string why(const std::string& folder) const {
        std::string text;
        return Segment::try_open(name_, text, folder).is_open() ? "open" : text;
    }
    bool refused(const std::string& folder, const std::string& text) const {
        const std::string said = why(folder);
        EXPECT_NE(said.find(text), std::string::npos) << said;
        return said.find(text) != std::string::npos;
    }
    std::string bytes() const {
        std::ifstream file(path_, std::ios::binary);
        return {std::istreambuf_iterator<char>(file), {}};
    }
    static void write(const std::string& path, const std::string& bytes) {
        std::ofstream(path, std::ios::binary) << bytes;
        ASSERT_EQ(::chmod(path.c_str(), 0640), 0);
    }
    // Runs `action` as another user, who may enter the folders of this test. Returns its result.
    template <typename Action>
    static int as_stranger(Action action) {
        const pid_t child = ::fork();
        if (child == 0) {
            if (::setresgid(kStranger, kStranger, kStranger) != 0 || ::setresuid(kStranger, kStranger, kStranger) != 0)
                ::_exit(99);
            ::_exit(action());
        }
        int status = 0;
        ::waitpid(child, &status, 0);
        return WEXITSTATUS(status);
    }
    const std::string folder_;
};

#define NEEDS_ROOT() \
    if (::geteuid() != 0) GTEST_SKIP() << "only root can act as another user"

TEST_F(TrustTest, AFolderThatOthersCanWriteToIsRefused) {
    const auto writer = alive();
    EXPECT_EQ(why(folder_), "open");
    for (const mode_t mode : {0777u, 01777u, 0775u, 0757u}) {  // also a sticky one, where any user can create a file
        ASSERT_EQ(::chmod(folder_.c_str(), mode), 0);
        EXPECT_TRUE(refused(folder_, folder_ + ": not a trusted folder: other users than its owner can write to it"));
        EXPECT_THROW(runtime_folder(), SetupError);
    }
    for (const mode_t mode : {0700u, 0755u}) {
        ASSERT_EQ(::chmod(folder_.c_str(), mode), 0);
        EXPECT_EQ(why(folder_), "open");
    }
}

TEST_F(TrustTest, SoIsAFolderInsideOfOne) {
    const std::string inner = folder_ + "/a/b";
    std::filesystem::create_directories(inner);
    set_runtime_folder(inner);
    const auto writer = alive();
    EXPECT_EQ(why(inner), "open");
    ASSERT_EQ(::chmod((folder_ + "/a").c_str(), 0777), 0);
    EXPECT_TRUE(refused(inner, folder_ + "/a: not a trusted folder"));
    EXPECT_EQ(why("/tmp").find("/tmp: not a trusted folder"), 0u);
}

TEST_F(TrustTest, InAStickyFolderOfRootOnlyAFolderOfRootOrOnesOwnIsTrusted) {
    NEEDS_ROOT();
    const std::string inner = folder_ + "/a/b";
    std::filesystem::create_directories(inner);
    set_runtime_folder(inner);
    const auto writer = alive();
    ASSERT_EQ(::chmod((folder_ + "/a").c_str(), 01777), 0);
    EXPECT_EQ(why(inner), "open");
    ASSERT_EQ(::chown(inner.c_str(), kStranger, kStranger), 0);
    EXPECT_TRUE(refused(inner, inner + ": not a trusted folder: another user than root or you made it"));
    EXPECT_EQ(as_stranger([&] { return why(inner).find("join the group of the segment") != std::string::npos ? 0 : 1; }), 0);
    ASSERT_EQ(::chown((folder_ + "/a").c_str(), kStranger, kStranger), 0);  // its owner may replace what is in it
    EXPECT_TRUE(refused(inner, folder_ + "/a: not a trusted folder: other users"));
}

TEST_F(TrustTest, AFolderInsideOfAnotherUsersIsRefused) {
    NEEDS_ROOT();
    const std::string middle = folder_ + "/a/b", inner = middle + "/c";
    std::filesystem::create_directories(inner);
    set_runtime_folder(inner);
    const auto writer = alive();
    ASSERT_EQ(::chown((folder_ + "/a").c_str(), kStranger, kStranger), 0);
    EXPECT_TRUE(refused(inner, "inside the folder of another user"));
    ASSERT_EQ(::chown(inner.c_str(), kStranger, kStranger), 0);
    EXPECT_EQ(why(inner), "open");  // the file of root in a folder of a user, who owns the folder above, too
    ASSERT_EQ(::chown(inner.c_str(), 1234, 1234), 0);
    EXPECT_TRUE(refused(inner, "inside the folder of another user"));
    ASSERT_EQ(::chown(middle.c_str(), 1234, 1234), 0);  // the same user owns b and c, another one a
    EXPECT_TRUE(refused(inner, "inside the folder of another user"));
}

TEST_F(TrustTest, AFileOfAnotherUserIsRefused) {
    NEEDS_ROOT();
    const auto writer = alive();
    ASSERT_EQ(::chown(path_.c_str(), kStranger, kStranger), 0);
    EXPECT_TRUE(refused(folder_, path_ + ": belongs neither to the owner of its folder nor to root"));
    ASSERT_EQ(::chown(folder_.c_str(), kStranger, kStranger), 0);
    EXPECT_EQ(why(folder_), "open");
    ASSERT_EQ(::chown(path_.c_str(), 0, 0), 0);
    EXPECT_EQ(why(folder_), "open");
}

TEST_F(TrustTest, NoLinkAndNoRelativePathIsFollowed) {
    const auto writer = alive();
    std::filesystem::create_directory_symlink(folder_, folder_ + "/link");
    EXPECT_TRUE(refused(folder_ + "/link", "symbolic links are not followed"));
    EXPECT_TRUE(refused(folder_ + "/link/", "symbolic links are not followed"));
    EXPECT_TRUE(refused(folder_ + "/../" + name_, "\"..\""));
    EXPECT_TRUE(refused("run", "is not a full path"));
    EXPECT_TRUE(refused("/" + std::string(300, 'x'), "too long"));
    EXPECT_EQ(why("/" + folder_ + "//"), "open");
    std::filesystem::rename(path_, folder_ + "/elsewhere");
    std::filesystem::create_symlink(folder_ + "/elsewhere", path_);
    EXPECT_TRUE(refused(folder_, path_));
    std::filesystem::rename(folder_ + "/elsewhere", path_);
}

TEST_F(TrustTest, ANameThatIsAPathIsRefused) {
    for (const char* name : {"../../x", "a/b", "a b", "\xc3\xa4", "", "0123456789012345678901234567890a"}) {
        std::string text;
        EXPECT_FALSE(Segment::try_open(name, text).is_open());
        EXPECT_NE(text.find("a name has"), std::string::npos) << text;
        Reader reader(name, "s0");
        EXPECT_NE(reader.why_not().find("a name has"), std::string::npos) << reader.why_not();
    }
}

// The file that is examined is the file that is mapped.
TEST_F(TrustTest, AFileThatIsExchangedWhileItIsOpenedIsRefusedOrTheDaemons) {
    NEEDS_ROOT();
    const auto writer = alive();
    const std::string forged = folder_ + "/forged";
    std::string copy = bytes();
    std::memcpy(copy.data() + offsetof(tactiled_header, version), "evil", 5);
    write(forged, copy);
    ASSERT_EQ(::chown(forged.c_str(), kStranger, kStranger), 0);
    std::atomic<bool> stop{false};
    std::thread exchanger([&] {
        while (!stop) ::renameat2(AT_FDCWD, path_.c_str(), AT_FDCWD, forged.c_str(), RENAME_EXCHANGE);
    });
    int opened = 0, refusals = 0;
    for (int i = 0; i < 3000 || ((opened == 0 || refusals == 0) && i < 300'000); ++i) {
        std::string text;
        const Segment segment = Segment::try_open(name_, text);
        ++(segment.is_open() ? opened : refusals);
        if (segment.is_open()) { ASSERT_STREQ(segment.header().version, "test"); }
    }
    stop = true;
    exchanger.join();
    EXPECT_GT(opened, 0);
    EXPECT_GT(refusals, 0);
}

// Before the daemon, between two daemons, and during a run.
TEST_F(TrustTest, ForcesForgedInDevShmReachNoReader) {
    NEEDS_ROOT();
    std::string forgery;
    {
        const auto writer = alive();
        auto lie = sample(0);
        lie.force_S_N[2] = -666;
        lie.t_ns = lie.t_published_ns = monotonic_ns() + 200'000'000;
        writer->publish(0, lie);
        forgery = bytes();
    }
    ::usleep(20'000);
    const std::string squat = std::string(TACTILED_SHARED_FOLDER) + "/tactiled." + name_;
    const auto forge = [&] {
        return as_stranger([&] {
            std::ofstream(squat, std::ios::binary) << forgery;
            const bool in_folder = !std::ofstream(path_, std::ios::binary).fail() || ::unlink(path_.c_str()) == 0;
            return in_folder ? 1 : 0;
        });
    };
    EXPECT_EQ(forge(), 0);
    Reader reader(name_, "s0");
    EXPECT_FALSE(reader.is_attached());
    auto writer = alive();
    const auto force_of_a_good_one = [&] {
        for (int i = 0; i < 200; ++i, ::usleep(10'000)) {
            beat(*writer, std::uint64_t(i));
            writer->publish(0, sample(0));
            if (const auto s = reader.latest(); s.quality == TACTILED_GOOD) return s.force_S_N[2];
        }
        return std::numeric_limits<double>::quiet_NaN();
    };
    EXPECT_EQ(force_of_a_good_one(), 0);
    EXPECT_EQ(forge(), 0);
    EXPECT_EQ(force_of_a_good_one(), 0);
    writer.reset();
    for (int i = 0; i < 5; ++i) {
        EXPECT_EQ(forge(), 0);
        ::usleep(12'000);
        const auto s = reader.latest();
        EXPECT_EQ(s.quality, unsigned(TACTILED_BAD));
        EXPECT_NE(s.force_S_N[2], -666);
    }
    ::unlink(squat.c_str());
}

TEST_F(TrustTest, AForeignLockFileInDevShmStopsNoStart) {
    NEEDS_ROOT();
    set_runtime_folder(TACTILED_SHARED_FOLDER);
    const std::string path = std::string(TACTILED_SHARED_FOLDER) + "/.tactiled." + name_;
    int held[2];
    ASSERT_EQ(::pipe(held), 0);
    const pid_t stranger = ::fork();
    if (stranger == 0) {
        char byte = 0;
        if (::setresuid(kStranger, kStranger, kStranger) != 0) ::_exit(1);
        const int fd = ::open(path.c_str(), O_RDWR | O_CREAT, 0666);
        (void)!::write(held[1], lock(fd) ? "1" : "0", 1);
        ::close(held[1]);
        (void)!::pause();
        ::_exit(byte);
    }
    char locked = 0;
    ASSERT_EQ(::read(held[0], &locked, 1), 1);
    EXPECT_EQ(locked, '1');
    {
        const auto writer = alive();
        std::string text;
        const Segment segment = Segment::try_open(name_, text);
        EXPECT_TRUE(segment.is_open()) << text;
        EXPECT_STREQ(segment.warning(), TACTILED_SHARED_WARNING);
    }
    EXPECT_EQ(::access(path.c_str(), F_OK), 0);  // another user's file is not removed
    ::kill(stranger, SIGKILL);
    ::waitpid(stranger, nullptr, 0);
    ::unlink(path.c_str());
    ::close(held[0]);
    ::close(held[1]);
}

TEST_F(TrustTest, AReaderLooksInTheFoldersInOrderAndStaysWithTheFirst) {
    const std::string users = folder_ + "/session";
    std::filesystem::create_directories(users + "/tactiled");
    const char* const session = std::getenv("XDG_RUNTIME_DIR");
    const std::string before = session != nullptr ? session : "";
    ::setenv("XDG_RUNTIME_DIR", users.c_str(), 1);
    set_runtime_folder(users + "/tactiled");
    auto own = alive();
    ::unsetenv(TACTILED_FOLDER_VARIABLE);
    Reader reader(name_, "s0");
    ASSERT_TRUE(reader.is_attached()) << reader.why_not();
    EXPECT_EQ(reader.segment().c()->folder, users + "/tactiled");
    if (::geteuid() == 0) {  // the service's folder comes first, except for a reader that is attached
        own->publish(0, sample(0));
        const auto service = alive();
        auto other = sample(0);
        other.force_S_N[0] = 7;
        service->publish(0, other);
        EXPECT_EQ(Segment::open(name_).c()->folder, std::string(TACTILED_SERVICE_FOLDER));
        own.reset();
        ::usleep(12'000);
        EXPECT_EQ(reader.latest().quality, unsigned(TACTILED_BAD));
        EXPECT_EQ(reader.segment().c()->folder, users + "/tactiled");
        EXPECT_EQ(Reader(name_, "s0").latest().force_S_N[0], 7);
    }
    ::setenv("XDG_RUNTIME_DIR", before.c_str(), 1);
    if (session == nullptr) ::unsetenv("XDG_RUNTIME_DIR");
}

TEST_F(TrustTest, ADaemonNamesItsFolderOrSaysWhyThereIsNone) {
    NEEDS_ROOT();
    EXPECT_EQ(as_stranger([] {
                  ::unsetenv(TACTILED_FOLDER_VARIABLE);
                  ::unsetenv("XDG_RUNTIME_DIR");
                  try {
                      (void)runtime_folder();
                      return 1;
                  } catch (const SetupError& error) {
                      return std::string(error.what()).find("--runtime-dir") != std::string::npos ? 0 : 2;
                  }
              }),
              0);
    const std::string users = folder_ + "/session";
    std::filesystem::create_directory(users);
    ASSERT_EQ(::chown(users.c_str(), kStranger, kStranger), 0);
    ::setenv("XDG_RUNTIME_DIR", users.c_str(), 1);
    EXPECT_EQ(as_stranger([&] {
                  ::unsetenv(TACTILED_FOLDER_VARIABLE);
                  ::umask(0077);
                  struct stat status {};
                  return runtime_folder() == users + "/tactiled" && ::stat((users + "/tactiled").c_str(), &status) == 0 &&
                                 (status.st_mode & 0777) == 0755
                             ? 0
                             : 1;
              }),
              0);
    EXPECT_EQ(as_stranger([&] {
                  set_runtime_folder(folder_);  // owned by root: a user's file would not be trusted there
                  try {
                      (void)runtime_folder();
                      return 1;
                  } catch (const SetupError&) { return 0; }
              }),
              0);
    ::unsetenv("XDG_RUNTIME_DIR");
}

}  // namespace
}  // namespace tactiled
