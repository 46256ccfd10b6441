// Serial format "toy": each frame is 0xA5 and one byte, the value of the only channel in units of the key `unit`.
#include "drivers/wire/stream_format.hpp"

namespace tactiled {
namespace {

constexpr std::uint8_t kHead = 0xA5;

class ToyDecoder final : public ByteDecoder {
public:
    ToyDecoder(double unit, LinkCounts& counts) : ByteDecoder(counts), unit_(unit) {}
    void reset() noexcept override {
        ByteDecoder::reset();
        has_head_ = false;
    }

private:
    bool take(std::uint8_t byte, Frame& frame) noexcept override {
        if (!has_head_) {
            has_head_ = byte == kHead;
            if (!has_head_) ++counts_[TACTILED_LINK_SKIPPED];
            return false;
        }
        has_head_ = false;
        frame = Frame{};
        frame.n_channels = 1;
        frame.channel[0] = byte * unit_;
        return true;
    }

    double unit_;
    bool has_head_ = false;
};

std::unique_ptr<StreamDecoder> make(Options& options, LinkCounts& counts) {
    return std::make_unique<ToyDecoder>(options.number("unit", {0.001, 1000}, 1), counts);
}

const StreamFormat entry{.name = "toy", .on_tcp = false, .make = make};

}  // namespace
}  // namespace tactiled
