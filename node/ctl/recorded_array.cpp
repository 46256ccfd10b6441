#include "node/ctl/recorded_array.hpp"

#include <fmt/format.h>

#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <utility>

#include "config/options.hpp"
#include "drivers/mcap/frame_message.hpp"
#include "drivers/mcap/taxels_message.hpp"
#include "node/ctl/array_message.hpp"
#include "node/ctl/array_text.hpp"

namespace tactiled::ctl {

ArraySchemas::ArraySchemas(mcap::Writer& file)
    : raw(file.add_schema(std::string(mcap::kTaxelsSchema), "ros2msg", std::string(mcap::kTaxelsDefinition))),
      array(file.add_schema(std::string(kArraySchema), "ros2msg", std::string(kArrayDefinition))),
      cloud(file.add_schema(std::string(kCloudSchema), "ros2msg", std::string(kCloudDefinition))) {}

RecordedRawTaxels::RecordedRawTaxels(const SegmentView& segment, std::uint32_t link, mcap::Writer& file,
                                     const ArraySchemas& schemas, const std::string& node)
    : segment_(segment),
      ring_(segment.c()->taxels[link]),
      file_(file),
      channel_(file.add_channel(schemas.raw, fmt::format("/{}/link/{}/taxels", node, segment.link(link).name), "cdr",
                                {{std::string(mcap::kLinkKey), segment.link(link).name}})),
      record_(ring_.record_size / sizeof(std::uint64_t)) {}

void RecordedRawTaxels::record(std::uint32_t number, const Frame& frame, std::uint64_t wall_ns) {
    const auto& head = *reinterpret_cast<const tactiled_taxels*>(record_.data());
    const auto size = std::uint32_t(record_.size() * sizeof(std::uint64_t));
    const bool is_kept = tactiled_ring_read(segment_.base(), &ring_, number, record_.data(), size) != 0;
    const TaxelShape shape{head.n_taxels, head.n_values};
    if (!is_kept || sizeof head + sizeof(float) * shape.size() > size) {
        ++lost_;
        return;
    }
    if (shape.size() == 0) return;
    const Taxels taxels{shape, {reinterpret_cast<const float*>(&head + 1), shape.size()}};
    mcap::encode_taxels(taxels, frame.t_ns, wall_ns, message_);
    file_.message(channel_, frame.sequence, wall_ns, message_);
}

RecordedArray::RecordedArray(const SegmentView& segment, mcap::Writer& file, const ArraySchemas& schemas, Setup setup)
    : segment_(segment), file_(file), setup_(std::move(setup)) {
    const auto channel = [&](std::uint16_t schema, const char* what) {
        return file.add_channel(schema, fmt::format("/{}/{}/{}", setup_.node, segment.sensor(setup_.sensor).name, what),
                                "cdr", setup_.about);
    };
    results_ = channel(schemas.array, "array");
    if (setup_.rate_Hz <= 0) return;
    taxels_ = channel(schemas.cloud, "taxels");
    if (setup_.csv.empty()) return;
    csv_.reset(std::fopen(setup_.csv.c_str(), "we"));
    if (csv_ == nullptr) throw SetupError(fmt::format("{}: {}", setup_.csv, std::strerror(errno)));
    rows_ = kArrayCsvHeader;
}

void RecordedArray::record(const tactiled_sample& sample, std::uint64_t wall_ns) {
    const auto number = std::uint32_t(sample.sequence);
    const bool has_taxels = is_due(sample.t_ns);
    tactiled_array head{};
    // Without its taxels only the head is copied.
    const bool is_kept = has_taxels ? segment_.array_of(setup_.sensor, sample, array_)
                                    : tactiled_ring_read(segment_.base(), &segment_.c()->array[setup_.sensor].ring, number,
                                                         &head, sizeof head) != 0;
    if (!is_kept) {
        ++lost_;
        return;
    }
    encode_array(has_taxels ? array_.head() : head, wall_ns, message_);
    file_.message(results_, number, wall_ns, message_);
    if (has_taxels) record_taxels(number, wall_ns);
}

// The mean rate is rate_Hz also where the sensor's rate is no multiple of it. After a gap there is no burst.
bool RecordedArray::is_due(std::uint64_t t_ns) {
    if (setup_.rate_Hz <= 0 || t_ns < due_ns_) return false;
    const auto period_ns = std::uint64_t(1e9 / setup_.rate_Hz);
    due_ns_ = t_ns - due_ns_ < period_ns ? due_ns_ + period_ns : t_ns + period_ns;
    return true;
}

void RecordedArray::record_taxels(std::uint32_t sequence, std::uint64_t wall_ns) {
    encode_cloud(cloud_of(segment_, setup_.sensor, array_), setup_.frame_id, wall_ns, message_);
    file_.message(taxels_, sequence, wall_ns, message_);
    if (csv_ == nullptr) return;
    append_array_csv(segment_, setup_.sensor, array_, rows_);
    if (std::fwrite(rows_.data(), 1, rows_.size(), csv_.get()) != rows_.size())
        throw std::runtime_error(fmt::format("{}: {}", setup_.csv, std::strerror(errno)));
    rows_.clear();
}

void RecordedArray::close() {
    if (csv_ != nullptr && std::fclose(csv_.release()) != 0)
        throw std::runtime_error(fmt::format("{}: {}", setup_.csv, std::strerror(errno)));
}

}  // namespace tactiled::ctl
