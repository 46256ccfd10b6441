// Serial format "adc": lines such as "ADC 512", the code of a converter of `bits` bits. The codes at both ends count as
// saturated.
#include <charconv>

#include "drivers/wire/delimited.hpp"
#include "drivers/wire/stream_format.hpp"

namespace tactiled {
namespace {

class AdcDecoder final : public LineDecoder<64> {
public:
    AdcDecoder(unsigned max, LinkCounts& counts) : LineDecoder(counts), max_(max) {}

private:
    bool read_line(std::string_view line, Frame& frame) noexcept override {
        if (!line.starts_with("ADC ")) return reject(TACTILED_LINK_BAD_VALUE);
        unsigned code = 0;
        const auto [end, error] = std::from_chars(line.data() + 4, line.data() + line.size(), code);
        if (error != std::errc{} || end != line.data() + line.size() || code > max_) return reject(TACTILED_LINK_BAD_VALUE);
        frame = Frame{};
        frame.n_channels = 1;
        frame.channel[0] = code;
        if (code == 0 || code == max_) frame.saturated = 1;
        return true;
    }

    unsigned max_;
};

std::unique_ptr<StreamDecoder> make(Options& options, LinkCounts& counts) {
    const auto bits = unsigned(options.integer("bits", {1, 24}, 12));  // the format's own key of the [[link]]
    return std::make_unique<AdcDecoder>((1u << bits) - 1, counts);
}

const StreamFormat entry{.name = "adc", .make = make};

}  // namespace
}  // namespace tactiled
