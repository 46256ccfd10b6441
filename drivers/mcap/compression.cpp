#include "drivers/mcap/compression.hpp"

#include <stdexcept>
#ifdef TACTILED_HAS_LZ4
#include <lz4frame.h>
#endif
#ifdef TACTILED_HAS_ZSTD
#include <zstd.h>
#endif

namespace tactiled::mcap {

struct Decompressor::Contexts {
#ifdef TACTILED_HAS_LZ4
    LZ4F_dctx* lz4 = nullptr;
#endif
#ifdef TACTILED_HAS_ZSTD
    ZSTD_DCtx* zstd = nullptr;
#endif
};

bool is_known_compression(std::string_view kind) {
#ifdef TACTILED_HAS_LZ4
    if (kind == "lz4") return true;
#endif
#ifdef TACTILED_HAS_ZSTD
    if (kind == "zstd") return true;
#endif
    return kind.empty();
}

std::string compress(std::string_view kind, [[maybe_unused]] std::string_view bytes) {
    std::string out;
    [[maybe_unused]] bool failed = true;
#ifdef TACTILED_HAS_LZ4
    if (kind == "lz4") {
        LZ4F_preferences_t wanted{};
        wanted.frameInfo.contentSize = bytes.size();
        out.resize(LZ4F_compressFrameBound(bytes.size(), &wanted));
        const std::size_t size = LZ4F_compressFrame(out.data(), out.size(), bytes.data(), bytes.size(), &wanted);
        failed = LZ4F_isError(size) != 0;
        if (!failed) out.resize(size);
    }
#endif
#ifdef TACTILED_HAS_ZSTD
    if (kind == "zstd") {
        out.resize(ZSTD_compressBound(bytes.size()));
        const std::size_t size = ZSTD_compress(out.data(), out.size(), bytes.data(), bytes.size(), 1);
        failed = ZSTD_isError(size) != 0;
        if (!failed) out.resize(size);
    }
#endif
    if (failed) throw std::runtime_error("compression " + std::string(kind) + " failed");
    return out;
}

Decompressor::Decompressor() : contexts_(std::make_unique<Contexts>()) {
#ifdef TACTILED_HAS_LZ4
    if (LZ4F_isError(LZ4F_createDecompressionContext(&contexts_->lz4, LZ4F_VERSION)) != 0) contexts_->lz4 = nullptr;
#endif
#ifdef TACTILED_HAS_ZSTD
    contexts_->zstd = ZSTD_createDCtx();
#endif
}

Decompressor::~Decompressor() {
#ifdef TACTILED_HAS_LZ4
    LZ4F_freeDecompressionContext(contexts_->lz4);
#endif
#ifdef TACTILED_HAS_ZSTD
    ZSTD_freeDCtx(contexts_->zstd);
#endif
}

bool Decompressor::run([[maybe_unused]] std::string_view kind, [[maybe_unused]] std::string_view bytes,
                       [[maybe_unused]] char* out, [[maybe_unused]] std::size_t size) noexcept {
#ifdef TACTILED_HAS_LZ4
    if (kind == "lz4" && contexts_->lz4 != nullptr) {
        LZ4F_resetDecompressionContext(contexts_->lz4);
        std::size_t done = 0, used = 0, left = 1;
        while (used < bytes.size() && left != 0) {
            std::size_t out_size = size - done, in_size = bytes.size() - used;
            left = LZ4F_decompress(contexts_->lz4, out + done, &out_size, bytes.data() + used, &in_size, nullptr);
            if (LZ4F_isError(left) != 0 || (out_size == 0 && in_size == 0)) return false;
            done += out_size;
            used += in_size;
        }
        return left == 0 && done == size;
    }
#endif
#ifdef TACTILED_HAS_ZSTD
    if (kind == "zstd" && contexts_->zstd != nullptr)
        return ZSTD_decompressDCtx(contexts_->zstd, out, size, bytes.data(), bytes.size()) == size;
#endif
    return false;
}

}  // namespace tactiled::mcap
