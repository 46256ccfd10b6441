#include "node/bridges/dds_domain.hpp"

#include <dds/dds.h>
#include <fmt/format.h>
#include <ros_messages.h>  // made of ros_messages.idl

#include <cmath>

#include "config/options.hpp"
#include "node/ctl/grasp_text.hpp"

namespace tactiled::bridges::dds {
namespace {

// The sha256 of the type's description (REP 2016). ROS 2 compares types by it since Iron.
constexpr char kWrenchHash[] = "typehash=RIHS01_8dc3deaf06b2ab281f9f9a742a8961c328ca7cec16e3fd6586d3a5c83fa78f77;";
constexpr char kDiagnosticsHash[] = "typehash=RIHS01_5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e;";
constexpr char kGraspHash[] = "typehash=RIHS01_c538df5ecbe1df0c9f0a187a87ae69c5ae8fbfa0b0d3d7f4a86c53fc0d4885e7;";

// A writer keeps samples for a reliable reader that has lost some, such as one that did not run while the buffer of its
// socket was full. kLifespan bounds their age: an older value may not be shown as a healthy one, so that it is not sent
// again. kDepth bounds their memory: at 1 kHz it is reached at the same time.
constexpr dds_duration_t kLifespan = DDS_SECS(1);
constexpr std::int32_t kDepth = 1000;

dds_entity_t require(dds_entity_t result, const std::string& what) {
    if (result < 0) throw SetupError(fmt::format("DDS, {}: {}", what, dds_strretcode(result)));
    return result;
}

char* text(const std::string& s) { return const_cast<char*>(s.c_str()); }  // the library's structures know no const

builtin_interfaces_msg_dds__Time_ time_of(double t_s) {
    const double whole_s = std::floor(t_s);
    return {std::int32_t(whole_s), std::uint32_t((t_s - whole_s) * 1e9)};
}

std_msgs_msg_dds__Header_ header_of(double t_s, const std::string& frame) { return {time_of(t_s), text(frame)}; }

}  // namespace

std::string configuration(const DomainOptions& options) {
    // The loopback as ROS 2 configures it with ROS_LOCALHOST_ONLY=1: participants find each other at the ports of their
    // numbers. 119: the last number whose ports are of the same domain. A participant without a number finds those that have
    // one, and its own kind does not find it: n bridges and one reader make n pairs instead of n^2. A reader that starts
    // later waits for its next announcement.
    if (options.network.empty())
        return fmt::format(
            "<Domain><General><Interfaces><NetworkInterface address=\"127.0.0.1\"/></Interfaces>"
            "<AllowMulticast>false</AllowMulticast></General><Discovery><ParticipantIndex>{}</ParticipantIndex>"
            "<MaxAutoParticipantIndex>{}</MaxAutoParticipantIndex><Peers><Peer address=\"127.0.0.1\"/></Peers>"
            "{}</Discovery></Domain>",
            options.many ? "none" : "auto", options.many ? 31 : 119, options.many ? "<SPDPInterval>2s</SPDPInterval>" : "");
    const bool address = options.network.find_first_of(".:") != std::string::npos;
    return fmt::format("<Domain><General><Interfaces><NetworkInterface {}=\"{}\"/></Interfaces></General></Domain>",
                       address ? "address" : "name", options.network);
}

Domain::Domain(const DomainOptions& options) : best_effort_(options.best_effort) {
    domain_ =
        require(dds_create_domain(options.domain, configuration(options).c_str()), fmt::format("domain {}", options.domain));
    dds_qos_t* const qos = dds_create_qos();
    constexpr char kEnclave[] = "enclave=/;";
    dds_qset_userdata(qos, kEnclave, sizeof kEnclave - 1);
    participant_ = dds_create_participant(options.domain, qos, nullptr);
    dds_delete_qos(qos);
    if (participant_ < 0) {
        dds_delete(domain_);
        require(participant_, fmt::format("network {}", options.network.empty() ? "127.0.0.1" : options.network));
    }
    diagnostics_ = make_writer("diagnostics", &diagnostic_msgs_msg_dds__DiagnosticArray__desc, kDiagnosticsHash, false);
}

Domain::~Domain() { dds_delete(domain_); }

Domain::Writer Domain::make_writer(const std::string& topic, const void* type, const char* type_hash, bool best_effort) {
    dds_qos_t* const qos = dds_create_qos();
    dds_qset_durability(qos, DDS_DURABILITY_VOLATILE);
    // "Keep last": a reader that acknowledges nothing does not stop the writer, which forgets what it cannot deliver. The
    // library throttles writers that keep all samples only; 0 is the time for which write() may wait.
    dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, kDepth);
    dds_qset_lifespan(qos, kLifespan);
    dds_qset_reliability(qos, best_effort ? DDS_RELIABILITY_BEST_EFFORT : DDS_RELIABILITY_RELIABLE, 0);
    dds_qset_userdata(qos, type_hash, std::char_traits<char>::length(type_hash));
    const dds_entity_t of = dds_create_topic(participant_, static_cast<const dds_topic_descriptor_t*>(type),
                                             ("rt/" + topic).c_str(), nullptr, nullptr);
    const dds_entity_t writer = of < 0 ? of : dds_create_writer(participant_, of, qos, nullptr);
    dds_delete_qos(qos);
    if (of >= 0) dds_delete(of);  // the writer keeps it
    return require(writer, "topic " + topic);
}

Domain::Writer Domain::wrench_writer(const std::string& topic) {
    return make_writer(topic, &geometry_msgs_msg_dds__WrenchStamped__desc, kWrenchHash, best_effort_);
}

Domain::Writer Domain::grasp_writer(const std::string& topic) {
    return make_writer(topic, &tactiled_msgs_msg_dds__Grasp__desc, kGraspHash, false);
}

void Domain::remove(Writer writer) { dds_delete(writer); }

bool Domain::write(Writer writer, const Stamped& at, const double (&force_N)[3], const double (&torque_Nm)[3]) {
    const geometry_msgs_msg_dds__WrenchStamped_ message{
        header_of(at.t_s, at.frame), {{force_N[0], force_N[1], force_N[2]}, {torque_Nm[0], torque_Nm[1], torque_Nm[2]}}};
    return dds_write(writer, &message) == DDS_RETCODE_OK;
}

bool Domain::write(Writer writer, const Stamped& at, double until_s, const tactiled_grasp& grasp, std::uint32_t quality,
                   std::uint32_t weight_quality) {
    const std::string state = ctl::grip_state_text(grasp.state), weight_state = ctl::weight_state_text(grasp.weight_state),
                      doubts = ctl::doubts_text(grasp.weight_doubts);
    const tactiled_msgs_msg_dds__Grasp_ message{header_of(at.t_s, at.frame),
                                                time_of(until_s),
                                                std::uint8_t(quality),
                                                text(state),
                                                std::uint8_t(weight_quality),
                                                text(weight_state),
                                                text(doubts),
                                                grasp.weight_kg,
                                                grasp.weight_sd_kg,
                                                grasp.grasps,
                                                grasp.slips};
    return dds_write(writer, &message) == DDS_RETCODE_OK;
}

bool Domain::write(double t_s, const std::vector<Diagnosis>& diagnoses) {
    std::vector<std::vector<diagnostic_msgs_msg_dds__KeyValue_>> values;
    std::vector<diagnostic_msgs_msg_dds__DiagnosticStatus_> statuses;
    values.reserve(diagnoses.size());
    const std::string hardware = "tactiled", no_frame;
    for (const Diagnosis& d : diagnoses) {
        auto& of = values.emplace_back();
        for (const auto& [key, value] : d.values) of.push_back({text(key), text(value)});
        const auto n = std::uint32_t(of.size());
        statuses.push_back({d.level, text(d.name), text(d.message), text(hardware), {n, n, of.data(), false}});
    }
    const auto n = std::uint32_t(statuses.size());
    const diagnostic_msgs_msg_dds__DiagnosticArray_ message{header_of(t_s, no_frame), {n, n, statuses.data(), false}};
    return dds_write(diagnostics_, &message) == DDS_RETCODE_OK;
}

std::uint32_t Domain::readers(Writer writer) const {
    dds_publication_matched_status_t status{};
    return dds_get_publication_matched_status(writer, &status) == DDS_RETCODE_OK ? status.current_count : 0;
}

}  // namespace tactiled::bridges::dds
