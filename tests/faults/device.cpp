#include "device.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "clock.hpp"
#include "drivers/wire/ascii_line.hpp"
#include "drivers/wire/cobs_frame.hpp"

namespace tactiled::faults {
namespace {

constexpr AsciiFormat kLines{.channels = kChannels, .checksum = true, .sequence = true};
constexpr std::size_t kKernelBuffer = 4095;

bool happens(double rate, Random& random) { return rate > 0 && std::uniform_real_distribution<double>(0, 1)(random) < rate; }

}  // namespace

int level_of(unsigned sensor, std::uint32_t sequence, unsigned k) {
    const int phase = int(sequence % 512);
    const auto ramp = [&](int from, int to) { return std::clamp(double(phase - from) / (to - from), 0.0, 1.0); };
    double observed = 8 * std::min(phase, 512 - phase);
    if (is_jaw(sensor))
        observed = k == 0 ? 3000 * (ramp(192, 240) - ramp(416, 440)) : k == 2 ? -8000 * (ramp(64, 160) - ramp(448, 480)) : 0;
    return place_of(sensor, k) + int(observed);
}

int count_of(unsigned sensor, std::uint32_t sequence, unsigned k) {
    const std::uint32_t n = sequence & 0xFFFF;
    std::uint32_t hash = n * 2654435761u + sensor * 40503u + k * 2246822519u;
    hash ^= hash >> 15;
    hash *= 2246822519u;
    return level_of(sensor, sequence, k) + int(hash >> 26) - 32;
}

Cable::Cable(bool text) : is_text(text) {
    if (text)
        decoder_ = std::make_unique<AsciiDecoder>(kLines, counts);
    else
        decoder_ = std::make_unique<CobsDecoder>(counts);
}

std::string Cable::open() {
    if (!plugged || !opens) return "no such device";
    chunks_.clear();
    decoder_->reset();
    empty_ns_ = world_ns;
    since_ns_ = 0;
    return "";
}

void Cable::carry(std::uint64_t sent_ns, std::vector<std::uint8_t> bytes) {
    std::size_t waiting = bytes.size();
    for (const auto& chunk : chunks_) waiting += chunk.bytes.size();
    if (plugged && waiting <= kKernelBuffer) chunks_.push_back({arrival_ns(sent_ns), std::move(bytes)});
}

bool Cable::is_readable() const {
    const bool waits = !chunks_.empty() && chunks_.front().ready_ns <= world_ns;
    if (!waits) empty_ns_ = world_ns;
    return !plugged || has_more() || waits;
}

Status Cable::read(Frame& frame, int) noexcept {
    const auto next = [&] {
        if (!decoder_->next(frame)) return false;
        frame.since_ns = since_ns_;
        return true;
    };
    if (next()) return Status::frame;
    if (!plugged) return Status::disconnected;
    std::vector<std::uint8_t> bytes;
    while (!chunks_.empty() && chunks_.front().ready_ns <= world_ns && bytes.size() < StreamDecoder::kMaxBytes) {
        auto& first = chunks_.front().bytes;
        const std::size_t room = chop != 0 ? chop - std::min<std::size_t>(chop, bytes.size()) : first.size();
        const auto end = first.begin() + std::ptrdiff_t(std::min(room, first.size()));
        bytes.insert(bytes.end(), first.begin(), end);
        first.erase(first.begin(), end);
        if (!first.empty()) break;
        chunks_.pop_front();
    }
    if (bytes.empty()) return Status::timeout;
    since_ns_ = world_ns - empty_ns_ > kStoppedNs ? empty_ns_ : 0;
    decoder_->push(bytes, world_ns, since_ns_ != 0 ? since_ns_ : world_ns);
    return next() ? Status::frame : Status::timeout;
}

Device::Device(unsigned sensor, unsigned number, Cable& cable, std::uint32_t first_sequence, std::uint64_t first_ns)
    : sensor_(sensor), number_(number), cable_(cable), sequence_(first_sequence), next_ns_(first_ns), truth_(65536) {}

void Device::send(std::uint64_t until_ns, Random& random) {
    for (; next_ns_ <= until_ns; next_ns_ += period_ns) {
        // If only a second device is received, it cannot be distinguished from the first one.
        const bool two = doubled && !silent && !garbage && !wrong_length && !foreign;
        const bool second_first = two && random() % 2 == 0;
        if (second_first) send_of_the_second(next_ns_);
        if (!silent) send_one(next_ns_, random);
        if (two && !second_first) send_of_the_second(next_ns_);
    }
}

void Device::jump_to(std::uint32_t sequence) {
    sequence_ = sequence;
    jumped_ns = world_ns;
}

std::vector<std::uint8_t> Device::encode(const Frame& frame) const {
    if (cable_.is_text) {
        std::array<char, kAsciiMaxBytes * 2> out;
        AsciiFormat format = kLines;
        format.channels = frame.n_channels;
        const std::size_t size = encode_ascii(frame, format, out);
        return {out.begin(), out.begin() + std::ptrdiff_t(size)};
    }
    std::array<std::uint8_t, kCobsMaxEncoded> out;
    const std::size_t size = encode_cobs(frame, 24, out);
    return {out.begin(), out.begin() + std::ptrdiff_t(size)};
}

// It measures the force of the sensor's neighbour.
void Device::send_of_the_second(std::uint64_t t_ns) {
    if (!second_sequence_) second_sequence_ = sequence_ + 10'000;
    const std::uint32_t sequence = (*second_sequence_)++;
    Frame frame;
    frame.has_sequence = true;
    frame.sequence = is_text() ? sequence : sequence & 0xFFFF;
    frame.device = std::uint16_t(number_);
    frame.n_channels = kChannels;
    for (unsigned k = 0; k < kChannels; ++k) frame.channel[k] = count_of((sensor_ + 1) % kSensors, sequence, k);
    sent_[n_sent_++ % sent_.size()] = sequence;
    truth_[sequence & 0xFFFF] = {.arrived_ns = cable_.arrival_ns(t_ns), .undetected = undetected_ + 1, .second = true};
    doubled_ns = world_ns;
    cable_.carry(t_ns, encode(frame));
}

void Device::send_one(std::uint64_t t_ns, Random& random) {
    Frame frame;
    frame.has_sequence = true;
    frame.sequence = sequence_;
    frame.device = std::uint16_t(foreign ? 9 : number_);
    frame.n_channels = other_shape ? kChannels + 1 : kChannels;
    for (unsigned k = 0; k < kChannels; ++k) frame.channel[k] = count_of(sensor_, sequence_, k) + offset;
    const bool stuck = frozen || zeros;
    if (!stuck) std::copy_n(frame.channel.begin(), kChannels, frozen_at_.begin());
    if (frozen) std::copy_n(frozen_at_.begin(), kChannels, frame.channel.begin());
    if (zeros) frame.channel = {};
    if (saturate) frame.channel[2] = 8'388'607;
    if (missing || nan) {
        frame.missing = 1u << 1;
        frame.channel[1] = std::numeric_limits<double>::quiet_NaN();
    }
    const bool spike = !spiked_ && happens(spikes, random);  // two in a row would be a level
    spiked_ = spike;
    if (spike) frame.channel[0] += 200'000;
    const int undetected = zeros ? 1 : frozen ? 2 : offset != 0 ? 3 : 0;
    if (undetected != std::exchange(undetected_before_, undetected) && undetected != 0) ++undetected_;
    Truth& truth = truth_[sequence_ & 0xFFFF];
    truth.arrived_ns = cable_.arrival_ns(t_ns);
    truth.undetected = undetected != 0 ? undetected_ : 0;
    truth.beside = undetected == 3;
    truth.spike = spike;
    sent_[n_sent_++ % sent_.size()] = sequence_++;
    if (happens(drops, random)) return;

    std::vector<std::uint8_t> bytes = encode(frame);
    if (garbage)
        for (auto& byte : bytes) byte = std::uint8_t(random());
    if (wrong_length) bytes[std::min<std::size_t>(3, bytes.size() - 1)] ^= 0x55;
    if (happens(flips, random)) bytes[random() % bytes.size()] ^= std::uint8_t(1u << random() % 8);
    if (happens(cuts, random)) bytes.resize(bytes.size() / 2);
    if (happens(swaps, random) && held_back_.empty()) {
        held_back_ = std::move(bytes);
        held_back_sequence_ = frame.sequence;
        return;
    }
    if (happens(repeats, random)) cable_.carry(t_ns, bytes);
    cable_.carry(t_ns, std::move(bytes));
    if (held_back_.empty()) return;
    truth_[held_back_sequence_ & 0xFFFF].arrived_ns = truth.arrived_ns;
    cable_.carry(t_ns, std::exchange(held_back_, {}));
}

}  // namespace tactiled::faults
