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
    std::string network;  // "": the loopback alone; else name or address of an interface
    bool reliable = false;
    bool many = false;  // many bridges on this machine: they do not discover each other
};

// Configuration of Cyclone DDS for these options.
std::string configuration(const DomainOptions& options);

struct Diagnosis {
    std::string name, message;
    std::uint8_t level;  // 0 OK, 1 WARN, 2 ERROR, 3 STALE
    std::vector<std::pair<std::string, std::string>> values;
};

class Domain {
public:
    // setup: throws SetupError where the network or the domain cannot be used
    explicit Domain(const DomainOptions& options);
    ~Domain();
    Domain(const Domain&) = delete;
    Domain& operator=(const Domain&) = delete;

    using Writer = std::int32_t;
    // geometry_msgs/WrenchStamped on /`topic`, with ROS' QoS of sensor data. setup: throws SetupError
    Writer wrench_writer(const std::string& topic);
    void remove(Writer writer);
    // False: dropped. A component that the sensor does not measure is NaN. rt: does not wait for readers
    bool write(Writer writer, const std::string& frame, double t_s, const tactiled_sample& sample);
    // diagnostic_msgs/DiagnosticArray on /diagnostics.
    bool write(double t_s, const std::vector<Diagnosis>& diagnoses);
    // Readers of a writer, of other programs.
    [[nodiscard]] std::uint32_t readers(Writer writer) const;

private:
    Writer make_writer(const std::string& topic, const void* type, const char* type_hash, bool reliable);

    bool reliable_;
    Writer domain_ = 0, participant_ = 0, diagnostics_ = 0;
};

}  // namespace tactiled::bridges::dds
