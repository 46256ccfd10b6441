#include "drivers/mcap/taxels_message.hpp"

#include "drivers/mcap/cdr.hpp"

namespace tactiled::mcap {

const std::string_view kTaxelsDefinition =
    R"(# The raw taxels of the frame with the same t_ns, as its driver delivered them. The frame is the link's next message.
builtin_interfaces/Time stamp  # wall clock of t_ns
uint64 t_ns      # CLOCK_MONOTONIC
uint16 taxels
uint16 values    # of each taxel
float32[] value  # value v of taxel i is [v * taxels + i]; NaN: missing, infinite: at a limit of its range
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
)";

void encode_taxels(const Taxels& taxels, std::uint64_t t_ns, std::uint64_t wall_ns, std::string& out) {
    CdrWriter cdr(out);
    cdr.put(std::int32_t(wall_ns / 1'000'000'000u));
    cdr.put(std::uint32_t(wall_ns % 1'000'000'000u));
    cdr.put(t_ns);
    cdr.put(taxels.shape.taxels);
    cdr.put(taxels.shape.values);
    cdr.put(taxels.value);
}

bool decode_taxels(std::span<const char> bytes, RecordedTaxels& taxels) {
    CdrReader cdr(bytes);
    (void)cdr.get<std::int32_t>();
    (void)cdr.get<std::uint32_t>();
    taxels.t_ns = cdr.get<std::uint64_t>();
    taxels.shape.taxels = cdr.get<std::uint16_t>();
    taxels.shape.values = cdr.get<std::uint16_t>();
    const bool is_possible = taxels.shape.taxels <= kMaxTaxels && taxels.shape.values <= kMaxTaxelValues;
    if (!is_possible || cdr.get<std::uint32_t>() != taxels.shape.size()) return false;
    taxels.value.resize(taxels.shape.size());
    cdr.get(std::span(taxels.value));
    return !cdr.failed();
}

}  // namespace tactiled::mcap
