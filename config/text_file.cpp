#include "config/text_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <utility>

namespace tactiled {
namespace {

class File {
public:
    explicit File(int fd) : fd_(fd) {}
    ~File() {
        if (fd_ >= 0) ::close(fd_);
    }
    File(const File&) = delete;
    File& operator=(const File&) = delete;
    [[nodiscard]] int fd() const { return fd_; }
    [[nodiscard]] bool close() {  // a network file system may report a lost write only here
        const int fd = std::exchange(fd_, -1);
        return ::close(fd) == 0;
    }

private:
    int fd_;
};

std::string why_not_opened(const std::string& path, int error) {
    if (path.empty()) return "the path is empty; give the path of a file";
    std::error_code ignored;
    if (error == ENOENT && path.front() != '/')
        return fmt::format("there is no such file, seen from the folder {}; give the path of one that exists",
                           std::filesystem::current_path(ignored).string());
    if (error == ENOENT) return "there is no such file; give the path of one that exists";
    if (error == EACCES) return fmt::format("user {} may not read it; change its rights or its owner", ::geteuid());
    return fmt::format("cannot be opened: {}", std::strerror(error));
}

bool write_all(int fd, std::string_view bytes) {
    while (!bytes.empty()) {
        const ssize_t n = ::write(fd, bytes.data(), bytes.size());
        if (n < 0 && errno == EINTR) continue;
        if (n < 0) return false;
        bytes.remove_prefix(std::size_t(n));
    }
    return true;
}

thread_local TextFiles* text_files = nullptr;

}  // namespace

TextFiles::TextFiles(List from) : list_(std::move(from)), notes_(list_.empty()), before_(text_files) { text_files = this; }

TextFiles::~TextFiles() { text_files = before_; }

bool is_text_file_there(const std::string& path) {
    if (text_files == nullptr || text_files->notes_) return ::access(path.c_str(), F_OK) == 0;
    for (const auto& file : text_files->list_)
        if (file.first == path) return true;
    return false;
}

std::optional<std::string> read_text_file(const std::string& path, std::size_t max_bytes, Problems& problems) {
    const auto refuse = [&](const std::string& why) {
        problems.add(path.empty() ? "\"\"" : path, 0, why);
        return std::nullopt;
    };
    if (text_files != nullptr && !text_files->notes_) {
        for (const auto& [name, bytes] : text_files->list_)
            if (name == path) return bytes;
        return refuse("is not in the recording");
    }
    const File file(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY));
    if (file.fd() < 0) return refuse(why_not_opened(path, errno));
    struct stat about {};
    if (::fstat(file.fd(), &about) != 0) return refuse(fmt::format("cannot be examined: {}", std::strerror(errno)));
    if (S_ISDIR(about.st_mode)) return refuse("is a folder; give the path of a file in it");
    if (!S_ISREG(about.st_mode)) return refuse("is a pipe or a device; give the path of a regular file");

    // Reads until the end instead of st_size bytes: the file may grow meanwhile, and /proc reports 0.
    std::string bytes;
    char piece[1 << 16];
    for (;;) {
        const ssize_t n = ::read(file.fd(), piece, sizeof piece);
        if (n < 0 && errno == EINTR) continue;
        if (n < 0) return refuse(fmt::format("cannot be read: {}", std::strerror(errno)));
        if (n == 0) {
            if (text_files != nullptr) text_files->list_.emplace_back(path, bytes);
            return bytes;
        }
        bytes.append(piece, std::size_t(n));
        if (bytes.size() > max_bytes)
            return refuse(fmt::format("is larger than {} bytes; this is not the kind of file that is read here", max_bytes));
    }
}

std::string toml_text(const std::string& text) {
    std::string out = "\"";
    for (const char c : text) {
        if (c == '"' || c == '\\')
            out += fmt::format("\\{}", c);
        else if (static_cast<unsigned char>(c) < ' ' || c == '\x7f')
            out += fmt::format("\\u{:04x}", unsigned(c));
        else
            out += c;
    }
    return out + "\"";
}

void replace_file(const std::string& path, std::string_view bytes) {
    const std::filesystem::path target(path);
    const std::string folder = target.parent_path().empty() ? "." : target.parent_path().string();
    // One writer per process and name at a time; a file left by a dead process with this number is unused.
    const std::string temporary = fmt::format("{}/.{}.{}.tmp", folder, target.filename().string(), ::getpid());
    const auto refuse = [&](const char* step, bool remove) {
        const int error = errno;
        if (remove) ::unlink(temporary.c_str());
        throw SaveError(fmt::format("{}: not saved: {}: {}", path, step, std::strerror(error)));
    };
    struct stat about {};
    if (::stat(path.c_str(), &about) == 0 && !S_ISREG(about.st_mode) && !S_ISDIR(about.st_mode))
        throw SaveError(fmt::format("{}: not saved: it is a pipe or a device; give the path of a regular file", path));
    ::unlink(temporary.c_str());
    File file(::open(temporary.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0644));
    if (file.fd() < 0) refuse("a file beside it cannot be made", false);
    if (!write_all(file.fd(), bytes)) refuse("write", true);
    if (::fsync(file.fd()) != 0) refuse("fsync", true);
    if (!file.close()) refuse("close", true);
    if (::rename(temporary.c_str(), path.c_str()) != 0) refuse("rename", true);
    // Some file systems cannot sync a folder (EINVAL); the rename is then as durable as possible.
    const File parent(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    if (parent.fd() >= 0 && ::fsync(parent.fd()) != 0 && errno != EINVAL) refuse("fsync of the folder", false);
}

}  // namespace tactiled
