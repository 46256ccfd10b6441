// Writers of ROS 2 messages in one DDS domain, by Cyclone DDS, without ROS.
#pragma once
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "tactiled/layout.h"

namespace tactiled::bridges::dds {

struct DomainOptions {
    std::uint32_t domain = 0;
    std::string network;       // "": the loopback alone; else name or address of an interface
    bool best_effort = false;  // applies to wrenches
    bool many = false;         // many bridges on this machine: they do not discover each other
};

// Configuration of Cyclone DDS for these options.
std::string configuration(const DomainOptions& options);

struct Diagnosis {
    std::string name, message;
    std::uint8_t level;  // 0 OK, 1 WARN, 2 ERROR, 3 STALE
    std::vector<std::pair<std::string, std::string>> values;
};

struct Stamped {
    std::string frame;
    double t_s = 0;
};

class Domain {
public:
    // setup: throws SetupError where the network or the domain cannot be used
    explicit Domain(const DomainOptions& options);
    ~Domain();
    Domain(const Domain&) = delete;
    Domain& operator=(const Domain&) = delete;

    using Writer = std::int32_t;
    // geometry_msgs/WrenchStamped on /`topic`, reliable unless `best_effort`. setup: throws SetupError
    Writer wrench_writer(const std::string& topic);
    // tactiled_msgs/Grasp on /`topic`, reliable. setup: throws SetupError
    Writer grasp_writer(const std::string& topic);
    void remove(Writer writer);
    // False: dropped. A component that is not measured is NaN. rt: does not wait for readers
    bool write(Writer writer, const Stamped& at, const double (&force_N)[3], const double (&torque_Nm)[3]);
    // `quality`, `weight_quality`: enum tactiled_quality
    bool write(Writer writer, const Stamped& at, double until_s, const tactiled_grasp& grasp, std::uint32_t quality,
               std::uint32_t weight_quality);
    // diagnostic_msgs/DiagnosticArray on /diagnostics.
    bool write(double t_s, const std::vector<Diagnosis>& diagnoses);
    // Readers of a writer, of other programs.
    [[nodiscard]] std::uint32_t readers(Writer writer) const;

private:
    Writer make_writer(const std::string& topic, const void* type, const char* type_hash, bool best_effort);

    bool best_effort_;
    Writer domain_ = 0, participant_ = 0, diagnostics_ = 0;
};

}  // namespace tactiled::bridges::dds
