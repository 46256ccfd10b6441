#include "node/modbus/identify.hpp"

#include <algorithm>
#include <iterator>
#include <string_view>

namespace tactiled::modbus {
namespace {
constexpr std::size_t kBasicObjects = 3;
constexpr std::uint8_t kConformity = 0x82;  // regular objects, by stream and by individual access
// The project has no public address; this one is the manual that its package installs.
constexpr const char* kVendorUrl = "file:///usr/share/doc/tactiled";
constexpr std::uint8_t kServerId = 'T', kOn = 0xFF, kOff = 0;  // in the answer to function 17
constexpr std::string_view kServerText = "tactiled " TACTILED_VERSION;
}  // namespace

Identity::Identity(const std::string& node_name)
    : objects_{"tactiled",       "tactiled", TACTILED_VERSION, kVendorUrl, "tactiled force and grasp daemon",
               "register map 1", node_name} {}

std::size_t Identity::answer(std::span<const std::uint8_t> pdu, bool is_running,
                             std::span<std::uint8_t, kMaxPdu> out) const noexcept {
    if (pdu[0] == kReportServerId) {
        const std::uint8_t head[] = {kReportServerId, std::uint8_t(2 + kServerText.size()), kServerId,
                                     is_running ? kOn : kOff};
        const auto text = std::copy(std::begin(head), std::end(head), out.begin());
        return std::size_t(std::copy(kServerText.begin(), kServerText.end(), text) - out.begin());
    }
    const std::uint8_t code = pdu[2];
    std::size_t first = pdu[3];
    // There is no extended object: a device of a lower conformity answers with its own objects.
    const std::size_t end = code == kIndividual ? first + 1 : code == kBasic ? kBasicObjects : objects_.size();
    if (first >= end) first = 0;  // "if the object id does not match any known object, the server restarts at the beginning"
    const std::uint8_t head[] = {kEncapsulated, kReadIdentity, code, kConformity, 0, 0, std::uint8_t(end - first)};
    auto at = std::copy(std::begin(head), std::end(head), out.begin());
    for (std::size_t id = first; id < end; ++id) {  // all of them fit into one answer: no "more follows"
        *at++ = std::uint8_t(id);
        *at++ = std::uint8_t(objects_[id].size());
        at = std::copy(objects_[id].begin(), objects_[id].end(), at);
    }
    return std::size_t(at - out.begin());
}

}  // namespace tactiled::modbus
