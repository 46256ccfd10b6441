#include "node/modbus/service.hpp"

#include <algorithm>

namespace tactiled::modbus {
namespace {

constexpr std::uint64_t kLookAgainNs = 100'000'000;  // retry interval if there is no segment

bool writes(const Request& request) { return request.write.count != 0; }
bool reads_bits(const Request& request) { return request.function == kReadCoils || request.function == kReadInputs; }
bool reads_taxels(const Request& request) {
    return !reads_bits(request) && request.read.count != 0 &&
           areas_in(request.read.at, request.read.count).front().is_latched();
}
// Returns true if the answer depends on the sensors.
bool needs_view(const Request& request) {
    if (writes(request) || reads_bits(request) || request.function == kReportServerId) return true;
    const auto areas = areas_in(request.read.at, request.read.count);
    return std::any_of(areas.begin(), areas.end(),
                       [](const Area& area) { return !area.is_holding_only() && area.block != Block::constants; });
}

// Returns the part of a run that lies in [at, at + count).
Run common(Run run, int at, int count) {
    const int first = std::max<int>(run.at, at), end = std::min(run.at + run.count, at + count);
    return {std::uint16_t(first), std::uint16_t(std::max(end - first, 0))};
}

}  // namespace

Service::Service(std::string node_name, const ModbusSettings& settings, CommandRing& commands)
    : node_name_(std::move(node_name)),
      scratch_(settings.scratch),
      force_scales_(settings.force_scales),
      controls_(settings, commands),
      identity_(node_name_) {}

std::size_t Service::answer(std::span<const std::uint8_t> bytes, Session& session, Responder& responder) {
    counts_.requests.fetch_add(1, std::memory_order_relaxed);
    const auto refuse = [&](Exception exception) {
        counts_.exceptions.fetch_add(1, std::memory_order_relaxed);
        return responder.refuse(bytes, exception);
    };
    const auto pdu = responder.pdu_of(bytes);
    const Request request = check_pdu(pdu, scratch_);
    if (request.exception != kNone) return refuse(request.exception);
    if (request.function == kDiagnostics) return responder.send(bytes, pdu);  // "return query data"

    const std::uint64_t now_ns = monotonic_ns();
    const View view = needs_view(request) ? look() : View{};  // one frame for the whole request
    if (needs_view(request)) controls_.follow(view, now_ns);
    if (request.function == kEncapsulated || request.function == kReportServerId) {
        std::array<std::uint8_t, kMaxPdu> answer;
        return responder.send(bytes, std::span(answer).first(identity_.answer(pdu, view.alive, answer)));
    }
    if (writes(request)) {
        const Exception exception = now_ns < refuses_until_ns_ ? kBusy : controls_.check(request, view, session, now_ns);
        if (exception != kNone) return refuse(exception);
    }
    if (reads_taxels(request)) {  // may be refused, and then nothing is written
        const auto cells = std::span(tables_.registers).subspan(request.read.at, request.read.count);
        const Exception exception = taxels_.read(request.read, view, session.taxels, now_ns, cells);
        if (exception != kNone) return refuse(exception);
    }
    if (writes(request)) controls_.write(request, view, session, now_ns);
    if (reads_bits(request))
        fill_bits(view, session, now_ns);
    else if (request.read.count != 0 && !reads_taxels(request))
        fill_run(request.read, view, session, now_ns);
    return responder.reply(bytes, tables_);
}

View Service::look() {
    if (!segment_.is_open() || !segment_.is_current()) {
        const std::uint64_t now_ns = monotonic_ns();
        if (now_ns - segment_tried_ns_ >= kLookAgainNs) {
            std::string why;
            segment_tried_ns_ = now_ns;
            if (Segment fresh = Segment::try_open(node_name_, why); fresh.is_open()) segment_ = std::move(fresh);
        }
    }
    View view = segment_.is_open() ? view_of(segment_) : view_of_nothing();
    view.force_scales = &force_scales_;
    return view;
}

// Fills the cells of all areas in the run. Addresses between areas are never written and stay 0.
void Service::fill_run(Run run, const View& view, const Session& session, std::uint64_t now_ns) {
    for (const Area& area : areas_in(run.at, run.count))
        if (area.block != Block::scratch || scratch_)
            fill_registers(area, common(run, area.at, area.size), view, session, now_ns);
}

// Fills cells of one area.
void Service::fill_registers(const Area& area, Run run, const View& view, const Session& session, std::uint64_t now_ns) {
    if (area.is_holding_only()) return controls_.read(run, session, now_ns, &tables_.registers[run.at]);
    const auto cells = std::span(tables_.registers).subspan(area.at, area.size);
    if (area.block == Block::constants) return void(std::copy(constants().begin(), constants().end(), cells.begin()));
    // Fills only the blocks that the request touches.
    const ClientReport client = controls_.report(session, now_ns);
    const unsigned size = area.repeats != 0 ? area.repeats : area.size;
    const unsigned first = (run.at - area.at) / size, last = (run.at + run.count - 1u - area.at) / size;
    for (unsigned n = first; n <= last; ++n) encode(area, cells.subspan(std::size_t(n) * size, size), view, n, client);
    if (run.at <= kCmdResult && run.at + run.count > kCmdResult) controls_.note_read(session);
    for (const Copy& copy : area.copies) {
        const Run asked = common(run, area.at + copy.at, copy.count);
        if (asked.count == 0) continue;
        const auto from = std::uint16_t(copy.from + asked.at - area.at - copy.at);
        fill_run({from, asked.count}, view, session, now_ns);
        std::copy_n(&tables_.registers[from], asked.count, &tables_.registers[asked.at]);
    }
}

void Service::fill_bits(const View& view, const Session& session, std::uint64_t now_ns) {
    std::array<std::uint16_t, kGlobalSize> global;
    encode(area_with(Block::global), global, view, 0, controls_.report(session, now_ns));
    encode_inputs(global, tables_.inputs);
    controls_.read_coils(view, tables_.coils);
}

}  // namespace tactiled::modbus
