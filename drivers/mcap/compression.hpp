// Compression of chunks by the names of MCAP: "" (none), "lz4" (frames), "zstd". A kind whose library was absent at
// build time is unknown.
#pragma once
#include <cstddef>
#include <memory>
#include <string>
#include <string_view>

namespace tactiled::mcap {

[[nodiscard]] bool is_known_compression(std::string_view kind);
// Returns `bytes` compressed. setup: throws std::runtime_error where the library fails
[[nodiscard]] std::string compress(std::string_view kind, std::string_view bytes);

class Decompressor {
public:
    Decompressor();
    ~Decompressor();
    Decompressor(const Decompressor&) = delete;
    Decompressor& operator=(const Decompressor&) = delete;

    // Writes exactly `size` bytes to `out`. Returns false if `bytes` do not contain that many.
    // rt: with "zstd" no allocation; bounded by `size`
    [[nodiscard]] bool run(std::string_view kind, std::string_view bytes, char* out, std::size_t size) noexcept;

private:
    struct Contexts;
    std::unique_ptr<Contexts> contexts_;
};

}  // namespace tactiled::mcap
