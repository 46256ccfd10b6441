// A sensor of a scene: its kind, its pose and its linear model. The finer models are effects.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "config/options.hpp"
#include "drivers/sim/block.hpp"

namespace tactiled::sim {

enum class Model { table, hair, capacitive, taxel };

// Strain gauges under a plate on four columns: Lee, Kim, Shikida, Sato.
struct TableSample {
    double gauge_factor_normal, gauge_factor_tangential;  // dR/R0 per strain, for a press and for the rest
    double plate_radius_m = 935e-6;
    // Strain per N of Fx, Fy, +Fz for R1 .. R8 at points of the plate, each row x_m, y_m, 24 strains; empty = not
    // given.
    std::vector<std::array<double, 26>> influence;
};

// Hairs in an elastomer: Cao et al. H1 .. H4 stand at 0, 90, 180, 270 degrees; a shear towards a hair lowers it. H0, if
// there is one, is a dummy: a hair of the same wafer beside the cap, which no load reaches.
struct HairSample {
    static constexpr std::size_t kHairs = 4;  // the dummy follows them
    double area_m2, height_m;
    double young_Pa, reference_young_Pa;  // gains are valid at the reference and inversely proportional to the modulus
    double root_distance_m;               // distance of a hair from the centre
};

// Four sectors C1 (+x) C2 (-x) C3 (+y) C4 (-y), a disc Cn in the middle, and a film Vp, over a soft pad.
struct CapacitiveSample {
    double disc_radius_m, inner_radius_m, outer_radius_m, opening_rad, centre_radius_m, gap_m;
    double young_Pa, poisson;
    double sector_pF, centre_pF;  // capacitance of the overlap at rest, without stray capacitance
    double stray_sector_pF, stray_centre_pF;
    double strain_per_N;   // relative change of the gap, at rest
    double shift_per_N_m;  // shift of the upper electrode, at rest
    double piezo_V_per_N;  // above the corner frequency of the leak; 0 = no film
};

// A taxel that reads the press on it, or all three forces, as a number of counts.
struct TaxelSample {
    double young_Pa;  // modulus of the skin
};

struct Sensor {
    std::string name;
    Model model{};
    std::vector<std::string> channels;  // "R1" .. "R8"; "H1" .. "H4" "H0"; "C1" .. "C4", "Cn", "Vp"; "Z" or "X" "Y" "Z"
    std::string unit;                   // "dR/R0", "pF" ("Vp": V) or "counts"
    Channels zero{};                    // readings without load
    std::array<Load, kMaxSensorChannels> gain{};  // unit per N of fx fy fz and per Nm of mx my
    // Change of the channel per 1 N, in its unit: its response to the axis with the smallest response above a tenth
    // of the largest. An error in N is thus rather overestimated than underestimated.
    Channels per_N{};
    double resolution_N{}, full_scale_N{};
    std::uint64_t serial = 1;  // identifies the individual sensor: its random differences are drawn from it
    TableSample table{};
    HairSample hair{};
    CapacitiveSample capacitive{};
    TaxelSample taxel{};

    // The sensor's position, its rotation about z against the scene's directions, and its share of the forces.
    double x_m = 0, y_m = 0, turn_rad = 0, share = 1;
    // half width of the sensor's cell in an array, where `share` follows the overlap with the contact; 0 = no array
    double half_width_m = 0;
    std::size_t array_row = 0, array_column = 0, rows = 1, columns = 1;
    // Distance of the taxels of an array that is one device; 0 = no such array. Gain, zero, resolution and full scale are
    // those of each of its rows * columns taxels, which measure the force on a square of this width.
    double pitch_m = 0;
    std::size_t every = 1;     // delivers each n-th sample of the scene
    std::uint16_t device = 0;  // device number of its frames

    [[nodiscard]] std::size_t n() const { return channels.size(); }
    [[nodiscard]] bool is_array() const { return pitch_m > 0; }
    [[nodiscard]] std::size_t taxels() const { return is_array() ? rows * columns : 0; }
    // Returns the sensor that taxel i is, in the order of the wire: row 0 has the largest y, column 0 the smallest x. setup
    [[nodiscard]] Sensor taxel_at(std::size_t i) const;
    // Returns true for a channel that responds to temperature and to no load.
    [[nodiscard]] bool is_dummy(std::size_t k) const { return model == Model::hair && k >= HairSample::kHairs; }
    [[nodiscard]] std::size_t find(std::string_view channel) const;  // n() if there is none

    // Returns the largest change of any channel, in N, if each component of the load changes by at most that much (N,
    // Nm).
    [[nodiscard]] double channel_N(const Load& change) const;
    // Returns the largest of these changes of channels (in their units), in N.
    [[nodiscard]] double largest_N(const Channels& change) const;
};

// Reads a [[sensor]] table of a scene; an array gives one sensor per taxel. Errors go to the options' Problems. setup
std::vector<Sensor> read_sensor(Options& options);

// Each model has its own file: it sets channels, unit, zero, gain and sample from the keys of the table. setup
void read_table(Options& options, Sensor& sensor);
void read_hair(Options& options, Sensor& sensor);
void read_capacitive(Options& options, Sensor& sensor);
void read_taxel(Options& options, Sensor& sensor);

}  // namespace tactiled::sim
