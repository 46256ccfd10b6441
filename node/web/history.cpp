#include "node/web/history.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <utility>

namespace tactiled::web {

void append_base64(std::string& out, const void* bytes, std::size_t size) {
    static constexpr char kDigits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    const auto* at = static_cast<const unsigned char*>(bytes);
    for (; size >= 3; size -= 3, at += 3) {
        const unsigned three = unsigned(at[0]) << 16 | unsigned(at[1]) << 8 | at[2];
        const char four[] = {kDigits[three >> 18], kDigits[three >> 12 & 63], kDigits[three >> 6 & 63], kDigits[three & 63]};
        out.append(four, 4);
    }
    if (size == 0) return;
    const unsigned three = unsigned(at[0]) << 16 | (size == 2 ? unsigned(at[1]) << 8 : 0u);
    const char four[] = {kDigits[three >> 18], kDigits[three >> 12 & 63], size == 2 ? kDigits[three >> 6 & 63] : '=', '='};
    out.append(four, 4);
}

void History::name_sensors(const std::vector<std::string>& names) {
    std::vector<Past> sensors;
    for (const auto& name : names) {
        const auto known = std::find_if(sensors_.begin(), sensors_.end(), [&](const Past& p) { return p.name == name; });
        sensors.push_back(known != sensors_.end() ? std::move(*known) : Past{name, std::vector<Interval>(kHistoryTicks)});
    }
    sensors_ = std::move(sensors);
    t_s_.resize(kHistoryTicks);
}

void History::add(const View& view) {
    if (sensors_.empty()) return;
    t_s_[next_] = double(view.taken_ns) / 1e9;
    for (std::size_t i = 0; i < sensors_.size(); ++i)
        sensors_[i].ring[next_] = i < view.n_sensors() ? view.interval[i] : Interval{};
    next_ = (next_ + 1) % kHistoryTicks;
    size_ = std::min(size_ + 1, kHistoryTicks);
}

void History::encode(std::size_t sensor, std::uint32_t components, std::string& out) const {
    const auto& ring = sensors_[sensor].ring;
    const auto column = [&](auto&& get) {
        std::vector<decltype(get(std::size_t()))> numbers;
        numbers.reserve(size_);
        for (std::size_t n = 0; n < size_; ++n) numbers.push_back(get((next_ + kHistoryTicks - size_ + n) % kHistoryTicks));
        out += '"';
        append_base64(out, numbers.data(), numbers.size() * sizeof numbers[0]);
        out += '"';
    };
    fmt::format_to(std::back_inserter(out), R"({{"sensor":{},"t_s":)", sensor);
    column([&](std::size_t n) { return t_s_[n]; });
    out += R"(,"quality":)";
    column([&](std::size_t n) { return ring[n].quality; });
    out += R"(,"reasons":)";
    column([&](std::size_t n) { return ring[n].reasons; });
    for (const auto& [key, values] :
         {std::pair{"value", &Interval::value}, std::pair{"low", &Interval::low}, std::pair{"high", &Interval::high}}) {
        fmt::format_to(std::back_inserter(out), R"(,"{}":[)", key);
        for (std::size_t c = 0, n = 0; c < 6; ++c)
            if ((components >> c & 1u) != 0) {
                if (n++ != 0) out += ',';
                column([&, values = values](std::size_t at) { return (ring[at].*values)[c]; });
            }
        out += ']';
    }
    out += '}';
}

}  // namespace tactiled::web
