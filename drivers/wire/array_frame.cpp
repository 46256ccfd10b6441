#include "drivers/wire/array_frame.hpp"

#include <zlib.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

namespace tactiled {
namespace {

static_assert(std::endian::native == std::endian::little, "the numbers of a piece are little-endian");

constexpr std::uint8_t kPiece = 3, kEcho = 4;
constexpr std::uint8_t kFlagMissing = 1, kFlagTime = 2;
constexpr std::size_t kCrc = 4, kEchoBytes = 12;
// Pieces of so many frames before the newest one are late. A device whose number goes back further has restarted.
constexpr std::uint32_t kLateFrames = 8;

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN(), kInfinite = std::numeric_limits<float>::infinity();

template <class T>
T get(const std::uint8_t* at) noexcept {
    T value;
    std::memcpy(&value, at, sizeof value);
    return value;
}

template <class T>
void put(std::vector<std::uint8_t>& bytes, T value) {
    const auto* const at = reinterpret_cast<const std::uint8_t*>(&value);
    bytes.insert(bytes.end(), at, at + sizeof value);
}

std::uint32_t crc_of(std::span<const std::uint8_t> bytes) noexcept {
    return std::uint32_t(::crc32_z(0, bytes.data(), bytes.size()));
}

std::size_t size_of(ArrayType type) noexcept {
    return type == ArrayType::i8 || type == ArrayType::u8 ? 1 : type == ArrayType::i16 || type == ArrayType::u16 ? 2 : 4;
}

// An unsigned 0 is no limit: the pads that count from 0 would be saturated without a load.
template <class T>
float value_of(T number) noexcept {
    if constexpr (std::is_integral_v<T>) {
        if (number == std::numeric_limits<T>::max()) return kInfinite;
        if (std::is_signed_v<T> && number == std::numeric_limits<T>::min()) return -kInfinite;
    }
    return float(number);
}

// Writes the numbers of the taxels from `piece.first` on, transposed. rt: bounded by the piece
template <class T>
void transpose(const ArrayPiece& piece, const std::uint8_t* numbers, float* out) noexcept {
    const std::size_t values = piece.shape.values;
    for (std::size_t v = 0; v < values; ++v) {
        float* const row = out + v * piece.shape.taxels + piece.first;
        for (std::size_t i = 0; i < piece.count; ++i) row[i] = value_of(get<T>(numbers + (i * values + v) * sizeof(T)));
    }
}

void read_numbers(const ArrayPiece& piece, const std::uint8_t* numbers, float* out) noexcept {
    switch (piece.type) {
        case ArrayType::i8: return transpose<std::int8_t>(piece, numbers, out);
        case ArrayType::u8: return transpose<std::uint8_t>(piece, numbers, out);
        case ArrayType::i16: return transpose<std::int16_t>(piece, numbers, out);
        case ArrayType::u16: return transpose<std::uint16_t>(piece, numbers, out);
        case ArrayType::i32: return transpose<std::int32_t>(piece, numbers, out);
        case ArrayType::f32: return transpose<float>(piece, numbers, out);
    }
}

void erase_missing(const ArrayPiece& piece, const std::uint8_t* bitmap, float* out) noexcept {
    for (std::size_t i = 0; i < piece.count; ++i)
        if ((bitmap[i / 8] >> i % 8 & 1) != 0)
            for (std::size_t v = 0; v < piece.shape.values; ++v) out[v * piece.shape.taxels + piece.first + i] = kNaN;
}

std::size_t bitmap_bytes(std::span<const std::uint8_t> message, const ArrayPiece& piece) noexcept {
    return (message[3] & kFlagMissing) != 0 ? (piece.count + 7u) / 8 : 0;
}

// Returns false if the message is no piece of an array of this shape.
bool read_header(std::span<const std::uint8_t> message, TaxelShape shape, ArrayPiece& piece) noexcept {
    if (message.size() < kArrayHeader + kCrc) return false;
    const std::uint8_t* const at = message.data();
    const std::uint8_t flags = at[3];
    if (at[1] >= kArrayMaxDevices || at[2] > std::uint8_t(ArrayType::f32) || (flags & ~(kFlagMissing | kFlagTime)) != 0)
        return false;
    piece = {.device = at[1],
             .type = ArrayType(at[2]),
             .sequence = get<std::uint32_t>(at + 4),
             .shape = {.taxels = get<std::uint16_t>(at + 12), .values = at[14]},
             .first = get<std::uint16_t>(at + 16),
             .count = get<std::uint16_t>(at + 18)};
    if ((flags & kFlagTime) != 0) piece.time_us = get<std::uint32_t>(at + 8);
    const std::size_t numbers = std::size_t(piece.count) * shape.values * size_of(piece.type);
    return piece.shape == shape && at[15] == 0 && piece.count != 0 && piece.first + piece.count <= shape.taxels &&
           message.size() == kArrayHeader + bitmap_bytes(message, piece) + numbers + kCrc;
}

}  // namespace

TaxelShape read_taxel_shape(Options& options, bool is_required) {
    const bool has_taxels = is_required || options.has("taxels");
    TaxelShape shape;
    if (has_taxels) {
        shape.taxels = std::uint16_t(options.integer("taxels", {1, double(kMaxTaxels)}));
        shape.values = std::uint16_t(options.integer("values", {1, double(kMaxTaxelValues)}, 1));
    } else if (options.has("values")) {
        (void)options.integer("values", {1, double(kMaxTaxelValues)});
        options.problem("values", "values needs taxels, the number of taxels of the array");
    }
    return shape;
}

std::size_t max_array_bytes(TaxelShape shape) noexcept {
    return std::min(kArrayMaxPiece, kArrayHeader + (shape.taxels + 7u) / 8 + shape.size() * sizeof(float) + kCrc);
}

bool is_array_message(std::uint8_t format) noexcept { return format == kPiece || format == kEcho; }

ArrayAssembler::ArrayAssembler(TaxelShape shape, LinkCounts& counts) : shape_(shape), counts_(counts) {
    for (Device& device : devices_) {
        device.has.resize(shape.taxels);
        device.value.resize(shape.size());
    }
}

void ArrayAssembler::reset() noexcept {
    for (Device& device : devices_) {
        device.tracker.reset();
        device.has_clock = device.has_begun = false;
        device.left = 0;
    }
    last_ = open_ = nullptr;
    echo_ = later_ = {};
}

ArrayAssembler::Taken ArrayAssembler::refuse(tactiled_link_count fault) noexcept {
    fault_ = fault;
    return Taken::refused;
}

ArrayAssembler::Taken ArrayAssembler::take(std::span<const std::uint8_t> message, const Arrival& arrival,
                                           Frame& frame) noexcept {
    if (message.size() < kEchoBytes + kCrc) return refuse(TACTILED_LINK_BAD_LENGTH);
    const std::uint32_t crc = crc_of(message.first(message.size() - kCrc));
    if (crc != get<std::uint32_t>(&message[message.size() - kCrc])) return refuse(TACTILED_LINK_BAD_CHECKSUM);
    if (message[0] == kPiece) return take_piece(message, crc, arrival, frame);
    return message[0] == kEcho ? take_echo_answer(message) : refuse(TACTILED_LINK_BAD_LENGTH);
}

ArrayAssembler::Taken ArrayAssembler::take_echo_answer(std::span<const std::uint8_t> message) noexcept {
    const bool is_right =
        message.size() == kEchoBytes + kCrc && message[1] < kArrayMaxDevices && message[2] == 0 && message[3] == 0;
    if (!is_right) return refuse(TACTILED_LINK_BAD_LENGTH);
    const StreamDecoder::Echo echo{
        .number = get<std::uint32_t>(&message[4]), .time_us = get<std::uint32_t>(&message[8]), .device = message[1]};
    (devices_[echo.device].left != 0 ? later_ : echo_) = echo;
    return Taken::used;
}

ArrayAssembler::Taken ArrayAssembler::take_piece(std::span<const std::uint8_t> message, std::uint32_t crc,
                                                 const Arrival& arrival, Frame& frame) noexcept {
    ArrayPiece piece;
    if (!read_header(message, shape_, piece)) return refuse(TACTILED_LINK_BAD_LENGTH);
    Device& device = devices_[piece.device];
    const bool continues = device.left != 0 && piece.sequence == device.piece.sequence;
    // Pieces of one frame have one time: a device that has restarted may use the number again.
    if (continues && piece.time_us != device.piece.time_us) return refuse(TACTILED_LINK_BAD_VALUE);
    if (!continues && !begin(device, piece, arrival)) {
        ++counts_[TACTILED_LINK_REPEATED];
        return Taken::used;
    }
    std::size_t fresh = 0;
    for (std::size_t i = piece.first; i < std::size_t(piece.first) + piece.count; ++i) fresh += device.has[i] == 0 ? 1 : 0;
    if (fresh == 0) {
        ++counts_[TACTILED_LINK_REPEATED];
        return Taken::used;
    }
    std::memset(device.has.data() + piece.first, 1, piece.count);
    const std::size_t bitmap = bitmap_bytes(message, piece);
    read_numbers(piece, &message[kArrayHeader + bitmap], device.value.data());
    if (bitmap != 0) erase_missing(piece, &message[kArrayHeader], device.value.data());
    device.content += crc;
    device.left -= fresh;
    if (device.left == 0 && open_ == &device) open_ = nullptr;
    return device.left == 0 && complete(device, arrival, frame) ? Taken::frame : Taken::used;
}

// Begins a frame with its first piece. Returns false if the piece is of an earlier frame.
bool ArrayAssembler::begin(Device& device, const ArrayPiece& piece, const Arrival& arrival) noexcept {
    const std::uint32_t behind = device.piece.sequence - piece.sequence;
    const bool is_whole = piece.count == shape_.taxels;  // SequenceTracker recognises one that repeats
    if (device.has_begun && behind <= kLateFrames && (behind != 0 || !is_whole)) return false;
    // No gap of the numbers shows this frame if the number goes back.
    if (device.left != 0 && std::int32_t(behind) > 0) ++counts_[TACTILED_LINK_LOST];
    open_ = &device;
    device.has_begun = true;
    device.piece = piece;
    device.first = arrival;
    device.left = shape_.taxels;
    device.content = 0;
    std::fill(device.has.begin(), device.has.end(), std::uint8_t{0});
    if (later_.number != 0 && later_.device == piece.device) echo_ = std::exchange(later_, {});
    return true;
}

bool ArrayAssembler::complete(Device& device, const Arrival& arrival, Frame& frame) noexcept {
    const std::uint32_t time_us = device.piece.time_us.value_or(0), sequence = device.piece.sequence;
    const bool has_time = device.piece.time_us.has_value();
    const auto elapsed_us = std::int32_t(time_us - std::uint32_t(device.time_us));
    const bool clock_went_back = has_time && device.has_clock && elapsed_us < 0;
    const auto verdict = device.tracker.next(sequence, 32, device.content, clock_went_back);
    if (!verdict.accept) {
        ++counts_[TACTILED_LINK_REPEATED];
        return false;
    }
    counts_[TACTILED_LINK_LOST] += verdict.lost;
    if (has_time)
        device.time_us = device.has_clock && !clock_went_back ? device.time_us + std::uint32_t(elapsed_us) : time_us;
    device.has_clock = has_time;
    last_ = verdict.contested ? nullptr : &device;
    frame = Frame{};
    frame.device = device.piece.device;
    frame.device_time_us = has_time ? device.time_us : 0;
    frame.lost = verdict.lost;
    put_number(frame, sequence, 32, verdict);
    if (device.first.first_ns < arrival.t_ns) {
        frame.since_ns = device.first.since_ns;
        frame.slice_ns = arrival.t_ns - device.first.first_ns;
    }
    return true;
}

Taxels ArrayAssembler::taxels() const noexcept {
    if (last_ == nullptr) return {};
    return {.shape = shape_, .value = last_->value};
}

namespace {

template <class T>
void put_number_as(std::vector<std::uint8_t>& bytes, float value) {
    constexpr double kTop = double(std::numeric_limits<T>::max()), kBottom = double(std::numeric_limits<T>::lowest());
    put(bytes, std::isnan(value) ? T{0} : T(std::clamp(std::nearbyint(double(value)), kBottom, kTop)));
}

void put_value(std::vector<std::uint8_t>& bytes, ArrayType type, float value) {
    switch (type) {
        case ArrayType::i8: return put_number_as<std::int8_t>(bytes, value);
        case ArrayType::u8: return put_number_as<std::uint8_t>(bytes, value);
        case ArrayType::i16: return put_number_as<std::int16_t>(bytes, value);
        case ArrayType::u16: return put_number_as<std::uint16_t>(bytes, value);
        case ArrayType::i32: return put_number_as<std::int32_t>(bytes, value);
        case ArrayType::f32: return put(bytes, value);
    }
}

}  // namespace

std::vector<std::uint8_t> encode_array_piece(const ArrayPiece& piece, std::span<const float> value) {
    const auto at = [&](std::size_t i, std::size_t v) { return value[v * piece.shape.taxels + piece.first + i]; };
    std::vector<std::uint8_t> bitmap((piece.count + 7u) / 8);
    bool has_missing = false;
    for (std::size_t i = 0; i < piece.count && piece.type != ArrayType::f32; ++i)
        for (std::size_t v = 0; v < piece.shape.values; ++v)
            if (std::isnan(at(i, v))) {
                bitmap[i / 8] = std::uint8_t(bitmap[i / 8] | 1u << i % 8);
                has_missing = true;
            }
    const int flags = (has_missing ? kFlagMissing : 0) | (piece.time_us ? kFlagTime : 0);
    std::vector<std::uint8_t> bytes{kPiece, piece.device, std::uint8_t(piece.type), std::uint8_t(flags)};
    put(bytes, piece.sequence);
    put(bytes, piece.time_us.value_or(0));
    put(bytes, piece.shape.taxels);
    put(bytes, std::uint8_t(piece.shape.values));
    put(bytes, std::uint8_t{0});
    put(bytes, piece.first);
    put(bytes, piece.count);
    if (has_missing) bytes.insert(bytes.end(), bitmap.begin(), bitmap.end());
    for (std::size_t i = 0; i < piece.count; ++i)
        for (std::size_t v = 0; v < piece.shape.values; ++v) put_value(bytes, piece.type, at(i, v));
    put(bytes, crc_of(bytes));
    return bytes;
}

std::vector<std::uint8_t> encode_array_echo(std::uint8_t device, std::uint32_t number, std::uint32_t time_us) {
    std::vector<std::uint8_t> bytes{kEcho, device, 0, 0};
    put(bytes, number);
    put(bytes, time_us);
    put(bytes, crc_of(bytes));
    return bytes;
}

}  // namespace tactiled
