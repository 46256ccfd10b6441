// Reads topics with eProsima's Fast DDS, another vendor's DDS than the bridge's, as an ordinary subscription of ROS 2 does:
// reliable, volatile, the last 10; and with ROS_LOCALHOST_ONLY=1. Prints one line a message: receive and send time in ns
// since 1970, frame, and six numbers of a WrenchStamped. Prints each writer to the standard error: topic, reliable or not,
// user data.
//     fastdds_reader DOMAIN SECONDS [--best-effort | --writers] TOPIC...     as in DDS: rt/gripper/left/wrench
//     rt/diagnostics: level, name, message, values; a topic that ends with /grasp: valid until in ns, quality, state, weight
#include <fastcdr/Cdr.h>
#include <fastcdr/FastBuffer.h>

#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <array>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/domain/DomainParticipantListener.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <string>
#include <thread>

namespace fast = eprosima::fastdds::dds;
namespace rtps = eprosima::fastrtps::rtps;

namespace {

struct Text {
    std::string line;
};

enum class Kind { kWrench, kDiagnostics, kGrasp };

Kind kind_of(const std::string& topic) {
    if (topic == "rt/diagnostics") return Kind::kDiagnostics;
    return topic.ends_with("/grasp") ? Kind::kGrasp : Kind::kWrench;
}

class Type : public fast::TopicDataType {
public:
    explicit Type(Kind kind) : kind_(kind) {
        setName(kind == Kind::kDiagnostics ? "diagnostic_msgs::msg::dds_::DiagnosticArray_"
                : kind == Kind::kGrasp     ? "tactiled_msgs::msg::dds_::Grasp_"
                                           : "geometry_msgs::msg::dds_::WrenchStamped_");
        m_typeSize = 65536;
    }
    bool deserialize(rtps::SerializedPayload_t* payload, void* data) override {
        eprosima::fastcdr::FastBuffer buffer(reinterpret_cast<char*>(payload->data), payload->length);
        eprosima::fastcdr::Cdr cdr(buffer, eprosima::fastcdr::Cdr::DEFAULT_ENDIAN, eprosima::fastcdr::Cdr::DDS_CDR);
        cdr.read_encapsulation();
        std::int32_t s = 0;
        std::uint32_t ns = 0;
        std::string frame;
        cdr >> s >> ns >> frame;
        std::string& line = static_cast<Text*>(data)->line;
        line = std::to_string(std::int64_t(s) * 1'000'000'000 + ns) + " " + (frame.empty() ? "-" : frame);
        return kind_ == Kind::kDiagnostics ? read_statuses(cdr, line)
               : kind_ == Kind::kGrasp     ? read_grasp(cdr, line)
                                           : read_numbers(cdr, line);
    }
    bool serialize(void*, rtps::SerializedPayload_t*) override { return false; }
    std::function<std::uint32_t()> getSerializedSizeProvider(void*) override {
        return [] { return 65536u; };
    }
    void* createData() override { return new Text; }
    void deleteData(void* data) override { delete static_cast<Text*>(data); }
    bool getKey(void*, rtps::InstanceHandle_t*, bool) override { return false; }

private:
    static bool read_numbers(eprosima::fastcdr::Cdr& cdr, std::string& line) {
        for (int i = 0; i < 6; ++i) {
            double value = 0;
            cdr >> value;
            std::array<char, 40> text;
            std::snprintf(text.data(), text.size(), " %.17g", value);
            line += text.data();
        }
        return true;
    }
    static bool read_statuses(eprosima::fastcdr::Cdr& cdr, std::string& line) {
        std::uint32_t statuses = 0;
        cdr >> statuses;
        for (; statuses > 0; --statuses) {
            std::uint8_t level = 0;
            std::string name, message, hardware, key, value;
            std::uint32_t values = 0;
            cdr >> level >> name >> message >> hardware >> values;
            line += " | " + std::to_string(level) + " " + name + " | " + message;
            for (; values > 0; --values) {
                cdr >> key >> value;
                line += " | " + key + " = " + value;
            }
        }
        return true;
    }
    static bool read_grasp(eprosima::fastcdr::Cdr& cdr, std::string& line) {
        std::int32_t s = 0;
        std::uint32_t ns = 0, grasps = 0, slips = 0;
        std::uint8_t quality = 0, weight_quality = 0;
        std::string state, weight_state, doubts;
        double kg = 0, sd_kg = 0;
        cdr >> s >> ns >> quality >> state >> weight_quality >> weight_state >> doubts >> kg >> sd_kg >> grasps >> slips;
        line += " " + std::to_string(std::int64_t(s) * 1'000'000'000 + ns) + " " + std::to_string(quality) + " " + state +
                " " + std::to_string(weight_quality) + " " + weight_state + " [" + doubts + "] " + std::to_string(kg) + " " +
                std::to_string(sd_kg) + " " + std::to_string(grasps) + " " + std::to_string(slips);
        return true;
    }
    Kind kind_;
};

class Writers : public fast::DomainParticipantListener {
    void on_publisher_discovery(fast::DomainParticipant*, rtps::WriterDiscoveryInfo&& found) override {
        if (found.status != rtps::WriterDiscoveryInfo::DISCOVERED_WRITER) return;
        const auto& qos = found.info.m_qos;
        const std::string data(qos.m_userData.begin(), qos.m_userData.end());
        std::fprintf(stderr, "writer %s %s %s\n", found.info.topicName().c_str(),
                     qos.m_reliability.kind == fast::RELIABLE_RELIABILITY_QOS ? "reliable" : "best-effort", data.c_str());
    }
};

class Listener : public fast::DataReaderListener {
    void on_data_available(fast::DataReader* reader) override {
        Text text;
        fast::SampleInfo info;
        while (reader->take_next_sample(&text, &info) == ReturnCode_t::RETCODE_OK) {
            if (!info.valid_data) continue;
            const auto now = std::chrono::system_clock::now().time_since_epoch();
            std::printf("%lld %s\n", static_cast<long long>(std::chrono::nanoseconds(now).count()), text.line.c_str());
        }
        std::fflush(stdout);
    }
};

}  // namespace

int main(int argc, char** argv) {
    if (argc < 4) return 2;
    const std::string option = argv[3];
    const bool best_effort = option == "--best-effort";
    auto* const factory = fast::DomainParticipantFactory::get_instance();
    fast::DomainParticipantQos where = fast::PARTICIPANT_QOS_DEFAULT;
    const auto loopback = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
    loopback->interfaceWhiteList.emplace_back("127.0.0.1");  // the setting of rmw_fastrtps for ROS_LOCALHOST_ONLY=1
    where.transport().use_builtin_transports = false;
    where.transport().user_transports.push_back(loopback);
    Writers writers;
    auto* const participant = factory->create_participant(
        fast::DomainId_t(std::atoi(argv[1])), where, option == "--writers" ? &writers : nullptr, fast::StatusMask::none());
    if (participant == nullptr) return 1;
    auto* const subscriber = participant->create_subscriber(fast::SUBSCRIBER_QOS_DEFAULT);
    Listener listener;
    for (int i = 3; i < argc; ++i) {
        const std::string topic_name = argv[i];
        if (topic_name == option && option.starts_with("--")) continue;
        fast::TypeSupport type(new Type(kind_of(topic_name)));
        type.register_type(participant);
        auto* const topic = participant->create_topic(topic_name, type.get_type_name(), fast::TOPIC_QOS_DEFAULT);
        fast::DataReaderQos qos = fast::DATAREADER_QOS_DEFAULT;
        qos.reliability().kind = best_effort ? fast::BEST_EFFORT_RELIABILITY_QOS : fast::RELIABLE_RELIABILITY_QOS;
        qos.durability().kind = fast::VOLATILE_DURABILITY_QOS;
        qos.history().kind = fast::KEEP_LAST_HISTORY_QOS;
        qos.history().depth = 10;
        if (subscriber->create_datareader(topic, qos, &listener) == nullptr) return 1;
    }
    std::this_thread::sleep_for(std::chrono::duration<double>(std::atof(argv[2])));
    participant->delete_contained_entities();
    factory->delete_participant(participant);
    return 0;
}
