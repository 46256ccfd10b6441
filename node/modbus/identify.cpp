#include "node/modbus/identify.hpp"

#include <algorithm>

namespace tactiled::modbus {
namespace {
constexpr std::uint8_t kBasic = 1, kIndividual = 4;  // read device id codes; 2 = regular, 3 = extended
constexpr std::size_t kBasicObjects = 3;
constexpr std::uint8_t kConformity = 0x82;  // regular, by stream and by individual access
}  // namespace

Identity::Identity(const std::string& node_name)
    : objects_{"tactiled",       "tactiled", TACTILED_VERSION, "", "tactiled force and grasp daemon",
               "register map 1", node_name} {}

std::size_t Identity::answer(std::span<const std::uint8_t> adu, std::span<std::uint8_t, kMaxAdu> out) const noexcept {
    const std::uint8_t code = adu[kMbapSize + 2];
    std::size_t first = adu[kMbapSize + 3];
    if (code < kBasic || code > kIndividual) return exception_adu(adu, kIllegalValue, out);
    if (code == kIndividual && first >= objects_.size()) return exception_adu(adu, kIllegalAddress, out);
    // There is no extended object: a device of a lower conformity answers with what it has.
    const std::size_t end = code == kIndividual ? first + 1 : code == kBasic ? kBasicObjects : objects_.size();
    if (first >= end) first = 0;  // "if the object id does not match any known object, the server restarts at the beginning"
    std::copy_n(adu.begin(), kMbapSize, out.begin());
    auto* const pdu = out.data() + kMbapSize;
    const std::uint8_t head[] = {kEncapsulated, 14, code, kConformity, 0, 0, std::uint8_t(end - first)};
    std::copy(std::begin(head), std::end(head), pdu);
    std::size_t size = std::size(head);
    for (std::size_t id = first; id < end; ++id) {  // they all fit one answer: no "more follows"
        pdu[size++] = std::uint8_t(id);
        pdu[size++] = std::uint8_t(objects_[id].size());
        size += std::size_t(std::copy(objects_[id].begin(), objects_[id].end(), pdu + size) - (pdu + size));
    }
    out[4] = 0;
    out[5] = std::uint8_t(size + 1);
    return kMbapSize + size;
}

}  // namespace tactiled::modbus
