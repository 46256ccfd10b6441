// Converts a snapshot to registers. Pure: the registers depend only on shared memory, on the client's commands and on the
// time of the request.
#pragma once
#include <array>
#include <cstdint>
#include <span>

#include "node/modbus/command_clients.hpp"
#include "node/modbus/table.hpp"
#include "tactiled/reader.hpp"

namespace tactiled::modbus {

// Converts a double in units of `scale` to i16: nearest, halves to even; beyond +-32767 it saturates and sets
// `saturated`; NaN is kNoI16. Never wraps.
std::uint16_t i16_of(double value, double scale, bool& saturated) noexcept;
// Does the same as i16_of for 0 .. 65534 and kNoU16; negative values saturate at 0.
std::uint16_t u16_of(double value, double scale, bool& saturated) noexcept;
// Does the same as i16_of for two registers, high word first; saturates at +-2147483647. NaN is kNoI32.
std::uint32_t i32_of(double value, double scale) noexcept;
// Writes a float32 to two registers. A number that is not finite, as double or as float32, becomes the quiet NaN.
void put_float(double value, bool low_word_first, std::uint16_t* out) noexcept;

// Does the reverse of i16_of or u16_of for the word of a writable register; NaN if it is "not available", or if a setting
// is as configured.
double decode(const Register& of, std::uint16_t word) noexcept;

// The words of the registers that may be written, 5000 .. 5227, and the values that they stand for.
class Words {
public:
    // At the start the settings are as configured, and all others are 0.
    Words() noexcept;
    [[nodiscard]] std::uint16_t& operator[](unsigned at) noexcept { return words_[at - kControlsAt]; }
    [[nodiscard]] std::uint16_t operator[](unsigned at) const noexcept { return words_[at - kControlsAt]; }
    // Returns the value of a u16 or i16: see decode().
    [[nodiscard]] double value(unsigned at) const noexcept { return decode(*writable_at(at), (*this)[at]); }

private:
    std::array<std::uint16_t, kControlsSize + kScratchSize> words_{};
};

// Unit of a force outside of the sensor blocks and by default in them, and the largest numbers of an i16 and of a u16.
inline constexpr double kForceUnit_N = 0.01;
inline constexpr int kForceScale = -2;  // its power of ten
inline constexpr int kMaxI16 = 32767;
inline constexpr std::uint16_t kMaxU16 = 65534;

// True if the jaws hold something; the grasp may have a value of its weight.
bool is_grasped(const tactiled_grasp& grasp) noexcept;
bool has_weight(const tactiled_grasp& grasp) noexcept;
bool is_stable(const tactiled_grasp& grasp) noexcept;

// The array of a head, and the number by which its pages are known.
struct LatchedArray {
    std::uint16_t token, pages;
    bool saturates;  // a value of a taxel exceeds the range of its register
    const Array& array;
};

// All data that one request may need, from one frame of the pipeline.
struct View {
    const Segment* segment = nullptr;  // nullptr: no daemon's segment could be read
    Snapshot snapshot;
    bool alive = false;                                            // the pipeline has published within watchdog_ms
    const std::array<int, kSensorBlocks>* force_scales = nullptr;  // powers of ten of the forces; nullptr: kForceScale
    const LatchedArray* latched = nullptr;  // for the rows of a head; nullptr: the sensor has no array

    [[nodiscard]] int force_scale(unsigned sensor) const noexcept {
        return force_scales != nullptr ? (*force_scales)[sensor] : kForceScale;
    }
};

// Returns the force of one count of a sensor's registers.
double force_unit_N(const View& view, unsigned sensor) noexcept;
// Takes a snapshot now. Samples are already judged by their age; if the pipeline is not alive, all are BAD.
View view_of(const Segment& segment) noexcept;
// Returns the number of existing sensors, and their mask, bit n = sensor n.
unsigned sensors_of(const View& view) noexcept;
std::uint32_t sensor_mask_of(const View& view) noexcept;
// Returns the view if there is nothing to read: every sensor value is a sentinel.
View view_of_nothing(std::uint32_t reason = TACTILED_DAEMON_STOPPED) noexcept;

// The data of Controls that a client's registers show.
struct ClientReport {
    CommandClient commands{};
    std::uint16_t heartbeat = 0;                    // the client writes it
    std::uint32_t status_bits = 0, fault_bits = 0;  // are added to STATUS and FAULT of the global block
};

// Encodes one block of an area with rows that have values; cells without a row become 0. `n` is the sensor if the area
// repeats the block. rt: wait-free
void encode(const Area& area, std::span<std::uint16_t> out, const View& view, unsigned n = 0,
            const ClientReport& client = {}) noexcept;
// Encodes the discrete inputs, 0 or 1 each, from the global block of the same time.
void encode_inputs(std::span<const std::uint16_t, kGlobalSize> global, std::span<std::uint8_t, kInputs> out) noexcept;

}  // namespace tactiled::modbus
