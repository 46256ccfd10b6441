// Figures of a calibration for its certificate and its report: those of ISO 376:2011, and the expanded uncertainty.
//
// They are computed from the labelled rows and the published forces, as `tactilectl decouple` writes them. With the
// deviation d = published force - label, less the deviation at the rest before:
//   f_c = mean(d) / F              interpolation: over the first rising hold of each session
//   b   = (max(d) - min(d)) / |F|  reproducibility: over the same holds; a session is a mounting
//   b'  = (max(d) - min(d)) / |F|  repeatability: over the rising holds of one session, the largest of all sessions
//   v   = mean |d' - d| / |F|      reversibility: d rising and d' falling between two rests
//   f_0 = (z' - z) / F_N           zero: the deviations at the rests before and after a series, F_N = full scale
//   c   = |z_300 - z_30| / F_N     creep: 30 s and 300 s after the beginning of a hold at full scale, or of a rest after it
// Source: ISO 376:2011, with the symbols of EURAMET cg-4. The standard takes deflections at equal forces, and divides by
// their mean. Here the published force is the reading; a difference of deviations also holds at forces that differ a
// little, and F differs from the mean reading by f_c.
//
// A hold is three labelled rows or more of one session with the same load (kSameLoad). A row without a label, or one that
// is not GOOD, does not end a hold, and has no part in a figure. At a rest no component exceeds LoadPeak::kRest. A hold is
// rising or falling if all labels since the hold before lie between the two loads.
#pragma once
#include <array>
#include <limits>
#include <string>
#include <vector>

#include "decoupling/fit/fit.hpp"

namespace tactiled {

// The expanded uncertainty (k = 2) of the reference: relative |load| + absolute.
struct Reference {
    std::string name;  // "" = not stated
    double relative = 0, force_N = 0, moment_Nm = 0;

    // Returns the expanded uncertainty of component c at this load, N or Nm; 0 = it was not stated.
    [[nodiscard]] double expanded(std::size_t c, double load) const noexcept;
};

inline constexpr double kCoverage = 2;  // factor of an expanded uncertainty, for 95 % of a normal distribution

struct FigureKind {
    const char *id, *symbol, *name;
};
// The order of AxisFigures::figures.
inline constexpr std::array<FigureKind, 6> kFigureKinds{
    {{"interpolation", "f_c", "relative interpolation error"},
     {"reproducibility", "b", "relative reproducibility error, with different mountings"},
     {"repeatability", "b'", "relative repeatability error, with one mounting"},
     {"reversibility", "v", "relative reversibility error"},
     {"zero", "f_0", "relative zero error"},
     {"creep", "c", "relative creep error, 30 s to 300 s"}}};

// One figure of one component at one load or more. Either it has values, or `absent` has the reason.
struct LoadFigure {
    std::vector<double> load;   // N or Nm; zero: the largest of the series
    std::vector<double> value;  // 0.01 = 1 %
    std::string absent;

    // Returns the index of the largest magnitude; there is one.
    [[nodiscard]] std::size_t worst() const noexcept;
};

struct AxisFigures {
    std::string name;  // one of kComponentNames
    double full_scale = kNaN;
    std::array<LoadFigure, kFigureKinds.size()> figures{};
    // Expanded uncertainty (kCoverage) of a published force just after a tare, at full scale and at the loads of the
    // interpolation error; it has the uncertainty of the reference. NaN, empty = not known
    double expanded = kNaN;
    std::vector<double> expanded_at{};
};

struct CertificateFigures {
    Reference reference;
    std::string recording;                     // name of the file, without its folder
    std::vector<std::string> sessions;         // their names; empty = one without a name
    std::vector<AxisFigures> axes{};           // in the order of the calibration's components
    std::size_t labelled = 0, good = 0;        // rows with a label, and those of them whose published force is GOOD
    double lowest_C = kNaN, highest_C = kNaN;  // temperature of the labelled rows; NaN = unknown
};

// `labelled`: as read from the file. `request`: the saturation limits are used. setup
CertificateFigures certificate_figures(const Labelled& labelled, const Calibration& calibration, const FitRequest& request,
                                       const Reference& reference);

// A part of a recording under one load. Indices are those of LoadedRows::rows.
struct Hold {
    std::size_t begin, end;
    std::size_t session;
    Wrench load{}, deviation{};  // means over the rows that are GOOD
    bool is_rest = false;
    std::size_t zero = kNone, before = kNone;  // hold of the last rest, and hold before, in this session

    static constexpr std::size_t kNone = std::numeric_limits<std::size_t>::max();
};

struct LoadedRows {
    std::vector<const LabelledRow*> rows;  // the labelled ones
    std::vector<Wrench> deviation;         // published force - label; NaN where it is not GOOD
    std::vector<Hold> holds;
    Wrench full_scale;  // NaN: not measured

    [[nodiscard]] bool is_same_load(const Wrench& a, const Wrench& b) const noexcept;
    [[nodiscard]] bool is_rest(const Wrench& load) const noexcept;
    // Returns 1 if component c rises from the hold before to this one, -1 if it falls, 0 if neither is certain.
    [[nodiscard]] int direction(const Hold& hold, std::size_t c) const noexcept;
};

// Returns the figures of component c, in the order of kFigureKinds. `loads`: whole loads of the interpolation error. setup
std::array<LoadFigure, kFigureKinds.size()> iso376_figures(const LoadedRows& loaded, std::size_t c,
                                                           std::vector<Wrench>& loads);

}  // namespace tactiled
