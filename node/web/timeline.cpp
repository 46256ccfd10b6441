#include "node/web/timeline.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <iterator>
#include <nlohmann/json.hpp>
#include <utility>

#include "node/ctl/verb.hpp"

namespace tactiled::web {

const std::array<const char*, 9> kFaultWords{"sensor-lost", "overrange", "open-gauge", "overrun", "calibration",
                                             nullptr,       "storage",   "bus",        "internal"};
const std::array<const char*, 10> kWarningWords{nullptr,  "drift", "lost-frames",    nullptr,       "tare",
                                                "budget", "rate",  "reload-refused", "jaws-differ", "hints-expired"};

std::vector<const char*> words_of(std::span<const char* const> all, std::uint32_t bits) {
    std::vector<const char*> words;
    for (std::size_t bit = 0; bit < all.size(); ++bit)
        if ((bits >> bit & 1u) != 0 && all[bit] != nullptr) words.push_back(all[bit]);
    return words;
}

namespace {

std::string listed(std::span<const char* const> all, std::uint32_t bits) {
    return fmt::format("{}", fmt::join(words_of(all, bits), ", "));
}

// Reasons that come and go without a change of what a value is worth.
constexpr std::uint32_t kQuiet = TACTILED_ARRIVAL_ONLY;

}  // namespace

void Timeline::add(const View& view, const std::string& subject, const std::string& text, int severity) {
    const double t_s = double(view.taken_ns) / 1e9;
    int looked_at = 0;
    for (auto event = events_.rbegin(); event != events_.rend() && looked_at < 8; ++event, ++looked_at)
        if (event->subject == subject && event->text == text && t_s - event->last_t_s < kRepeatS) {
            event->last_t_s = t_s;
            ++event->times;
            event->revision = ++revision_;
            return;
        }
    const std::uint64_t id = events_.empty() ? 1 : events_.back().id + 1;
    events_.push_back({id, ++revision_, view.wall_ms, t_s, t_s, 1, severity, subject, text});
    if (events_.size() > kMaxEvents) events_.pop_front();
}

void Timeline::observe_sensor(const View& view, std::uint32_t i) {
    const Interval& is = view.interval[i];
    const std::uint64_t now = std::uint64_t(is.quality) << 32 | (is.reasons & ~kQuiet);
    if (std::exchange(quality_[i], now) == now) return;
    add(view, view.segment->sensor(i).name, ctl::quality_text(is.quality, is.reasons & ~kQuiet),
        is.quality == TACTILED_GOOD        ? 0
        : is.quality == TACTILED_UNCERTAIN ? 1
                                           : 2);
}

void Timeline::observe(const View& view) {
    const bool was_any = std::exchange(any_, true);
    if (!was_any || alive_ != view.is_alive || why_ != view.why)
        add(view, "daemon", view.is_alive ? "publishes" : view.why, view.is_alive ? 0 : 2);
    alive_ = view.is_alive;
    why_ = view.why;
    if (!view.segment->is_open()) return;
    const auto& header = view.segment->header();
    const auto& node = view.snapshot.node;
    if (std::exchange(epoch_, header.epoch) != header.epoch) {  // another daemon counts anew
        if (was_any) add(view, "daemon", fmt::format("started, pid {}", header.pid), 0);
        quality_.fill(0);
        link_.fill(~0u);
        fault_ = warning_ = 0;
        slips_ = node.grasp.slips;
        reloads_ = view.reloads;
    }
    if (std::exchange(reloads_, view.reloads) != view.reloads) add(view, "daemon", "configuration reloaded", 0);
    for (std::uint32_t i = 0; i < view.n_sensors(); ++i) observe_sensor(view, i);
    for (std::uint32_t i = 0; i < view.n_links(); ++i) {
        const std::uint32_t state = __atomic_load_n(&view.segment->link(i).state, __ATOMIC_RELAXED);
        if (std::exchange(link_[i], state) == state) continue;
        const bool open = state == TACTILED_LINK_OPEN;
        add(view, fmt::format("link {}", view.segment->link(i).name), open ? "open" : "closed", open ? 0 : 2);
    }
    const std::uint32_t raised = node.fault & ~fault_, cleared = fault_ & ~node.fault;
    if (raised != 0) add(view, "fault", fmt::format("latched: {}", listed(kFaultWords, raised)), 2);
    if (cleared != 0) add(view, "fault", fmt::format("cleared: {}", listed(kFaultWords, cleared)), 0);
    const std::uint32_t warned = node.warning & ~warning_;
    if (warned != 0) add(view, "warning", listed(kWarningWords, warned), 1);
    fault_ = node.fault;
    warning_ = node.warning;
    if (std::exchange(slips_, node.grasp.slips) != node.grasp.slips) add(view, "grasp", "slip", 1);
}

std::uint64_t Timeline::encode(std::uint64_t revision, std::string& out) const {
    nlohmann::json list = nlohmann::json::array();
    for (const Event& e : events_)
        if (e.revision > revision)
            list.push_back({{"id", e.id},
                            {"wall_ms", e.wall_ms},
                            {"t_s", e.t_s},
                            {"last_t_s", e.last_t_s},
                            {"times", e.times},
                            {"severity", e.severity},
                            {"subject", e.subject},
                            {"text", e.text}});
    out += list.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
    return revision_;
}

}  // namespace tactiled::web
