// Reads a WrenchStamped topic with eProsima's Fast DDS, another vendor's DDS than the bridge's, with the settings of ROS 2
// for sensor data and ROS_LOCALHOST_ONLY=1. Prints one line a message: receive and send time in ns since 1970, frame, six
// numbers.
//     fastdds_reader DOMAIN SECONDS TOPIC...     as in DDS: rt/gripper/left/wrench; rt/diagnostics: level, name, message
#include <fastcdr/Cdr.h>
#include <fastcdr/FastBuffer.h>

#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <array>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
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

class Type : public fast::TopicDataType {
public:
    explicit Type(bool diagnostics) : diagnostics_(diagnostics) {
        setName(diagnostics ? "diagnostic_msgs::msg::dds_::DiagnosticArray_" : "geometry_msgs::msg::dds_::WrenchStamped_");
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
        return diagnostics_ ? read_statuses(cdr, line) : read_numbers(cdr, line);
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
            for (; values > 0; --values) cdr >> key >> value;
        }
        return true;
    }
    bool diagnostics_;
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
    auto* const factory = fast::DomainParticipantFactory::get_instance();
    fast::DomainParticipantQos where = fast::PARTICIPANT_QOS_DEFAULT;
    const auto loopback = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
    loopback->interfaceWhiteList.emplace_back("127.0.0.1");  // the setting of rmw_fastrtps for ROS_LOCALHOST_ONLY=1
    where.transport().use_builtin_transports = false;
    where.transport().user_transports.push_back(loopback);
    auto* const participant = factory->create_participant(fast::DomainId_t(std::atoi(argv[1])), where);
    if (participant == nullptr) return 1;
    auto* const subscriber = participant->create_subscriber(fast::SUBSCRIBER_QOS_DEFAULT);
    Listener listener;
    for (int i = 3; i < argc; ++i) {
        const std::string topic_name = argv[i];
        const bool diagnostics = topic_name == "rt/diagnostics";
        fast::TypeSupport type(new Type(diagnostics));
        type.register_type(participant);
        auto* const topic = participant->create_topic(topic_name, type.get_type_name(), fast::TOPIC_QOS_DEFAULT);
        fast::DataReaderQos qos = fast::DATAREADER_QOS_DEFAULT;
        qos.reliability().kind = diagnostics ? fast::RELIABLE_RELIABILITY_QOS : fast::BEST_EFFORT_RELIABILITY_QOS;
        qos.history().kind = fast::KEEP_LAST_HISTORY_QOS;
        qos.history().depth = 100;
        if (subscriber->create_datareader(topic, qos, &listener) == nullptr) return 1;
    }
    std::this_thread::sleep_for(std::chrono::duration<double>(std::atof(argv[2])));
    participant->delete_contained_entities();
    factory->delete_participant(participant);
    return 0;
}
