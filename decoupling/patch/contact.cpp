#include "decoupling/patch/contact.hpp"

#include <algorithm>
#include <cmath>

#include "decoupling/place.hpp"

namespace tactiled {
namespace {

constexpr double kFalse = 0.01;  // share of the frames in which noise alone shows a contact, or the axis of a round one
constexpr std::uint8_t kOutside = 0, kInContact = 1, kBeside = 2;  // of region_
constexpr float kNone = std::numeric_limits<float>::quiet_NaN();

void put_none(tactiled_array& array) noexcept {
    array.n_contact = array.peak_taxel = 0;
    array.peak_N = array.peak_sd_N = array.axis_rad = array.axis_sd_rad = kNone;
    array.area_m2 = array.area_sd_m2 = kNone;
    std::fill_n(array.cop_S_m, 3, kNone);
    std::fill_n(array.cop_sd_m, 3, kNone);
}

}  // namespace

Contact::Contact(const TaxelPlaces& places, const TaxelNoise& noise, double narrowest_m)
    : places_(places),
      noise_(noise),
      z_(float(std::sqrt(2 * std::log(double(places.n) / kFalse)))),
      limit_N_(z_ * noise.sd[2]),
      doubts_(places, noise, z_, narrowest_m),
      press_(places.n),
      region_(places.n) {
    terms_.reserve(places.n);
}

void Contact::forget(tactiled_array& array) noexcept {
    put_none(array);
    terms_.clear();
    doubt_ = {};
    doubted_N_ = predicted_N_ = 0;
}

float Contact::press(const TaxelForces& forces, const TaxelForces& zero, std::size_t i) const noexcept {
    float along = 0;
    for (std::size_t c = 0; c < 3; ++c)
        if (!forces.component[c].empty()) along += places_.normal[i][c] * (forces.component[c][i] - zero.component[c][i]);
    return -along;
}

void Contact::find(TaxelForces& forces, const TaxelForces& zero, const std::vector<TaxelOut>& out,
                   tactiled_array& array) noexcept {
    const std::size_t n = places_.n;
    forget(array);
    if (!(limit_N_ > 0)) return;  // the noise is unknown
    float* const p = press_.data();
    if (places_.is_flat()) {
        const float *const f = forces.component[2].data(), *const rest = zero.component[2].data();
        for (std::size_t i = 0; i < n; ++i) p[i] = rest[i] - f[i];
    } else {
        for (std::size_t i = 0; i < n; ++i) p[i] = press(forces, zero, i);
    }
    std::uint8_t* const region = region_.data();
    const float limit_N = limit_N_;
    unsigned n_contact = 0;
    for (std::size_t i = 0; i < n; ++i) region[i] = p[i] > limit_N;
    stated_ = forces.sd[2].empty() ? nullptr : &forces.sd;
    for (std::size_t i = 0; stated_ != nullptr && i < n; ++i)
        region[i] = region[i] != 0 && p[i] * p[i] > z_ * z_ * variance_along(i);
    for (std::size_t i = 0; i < n; ++i) n_contact += region[i];
    array.n_contact = n_contact;
    if (n_contact == 0) return;
    const auto peak = std::size_t(std::max_element(press_.begin(), press_.end()) - press_.begin());
    array.peak_taxel = std::uint32_t(peak);
    array.peak_N = press_[peak];
    array.peak_sd_N = std::hypot(noise_.sd[2], noise_.gain[peak] * press_[peak]);
    find_region();
    use_variances(out);
    add_doubts(forces);
    for (const TaxelOut& one : out)
        if (one.taxel == peak) array.peak_sd_N = std::sqrt(along_normal(one));
    array.area_m2 = places_.taxel_area_m2 * (float(array.n_contact) - float(boundary_) / 2);
    array.area_sd_m2 = places_.taxel_area_m2 * float(boundary_) / std::sqrt(12.f);
    double variance = 0;
    for (const Term& term : terms_) variance += term.variance;
    if (!(sum_N_ > kPlace_sd * std::sqrt(variance))) return;
    put_centre(array);
    put_axis(array);
}

// The variance that taxel i states along its normal, N^2.
float Contact::variance_along(std::size_t i) const noexcept {
    float variance = 0;
    for (std::size_t c = 0; c < 3; ++c) {
        const float sd = places_.normal[i][c] * (*stated_)[c][i];
        variance += sd * sd;
    }
    return variance;
}

void Contact::find_region() noexcept {
    boundary_ = 0;
    for (std::size_t i = 0; i < places_.n; ++i) {
        if (region_[i] != kInContact) continue;
        const TaxelPlaces::Neighbours& beside = places_.neighbours[i];
        bool is_edge = false;
        for (std::size_t k = 0; k < beside.n; ++k) {
            std::uint8_t& other = region_[beside.of[k]];
            is_edge = is_edge || other != kInContact;
            if (other == kOutside) other = kBeside;
        }
        boundary_ += is_edge ? 1 : 0;
    }
    sum_N_ = 0;
    centre_m_ = {};
    for (std::size_t i = 0; i < places_.n; ++i)
        if (region_[i] != kOutside) add_term(i);
    for (double& c : centre_m_) c /= sum_N_;
}

void Contact::add_term(std::size_t i) noexcept {
    const std::array<const float*, 3> r{places_.x.data(), places_.y.data(), places_.z.data()};
    const TaxelPlaces::Neighbours& beside = places_.neighbours[i];
    const double p = double(press_[i]), of_gain = double(noise_.gain[i]) * p;
    Term term{i, p, double(noise_.sd[2]) * double(noise_.sd[2]) + of_gain * of_gain, {}};
    if (stated_ != nullptr) term.variance = double(variance_along(i));
    for (std::size_t c = 0; c < 3; ++c) {
        double largest = 0, least = kLargest;
        const float pitch_m = places_.pitch_m[c];
        for (std::size_t k = 0; k < beside.n; ++k) {
            if (std::abs(r[c][beside.of[k]] - r[c][i]) <= pitch_m / 2) continue;
            largest = std::max(largest, double(press_[beside.of[k]]));
            least = std::min(least, std::max(0., double(press_[beside.of[k]])));
        }
        const double above = std::max(0., p - largest), across = std::max(0., largest - least);
        term.within[c] = (above * above / 12 + across * across / 720) * double(pitch_m) * double(pitch_m);
        centre_m_[c] += p * double(r[c][i]);
    }
    sum_N_ += p;
    terms_.push_back(term);
}

// Variance of the predicted press of a taxel, N^2.
float Contact::along_normal(const TaxelOut& one) const noexcept {
    float variance = 0;
    for (std::size_t c = 0; c < 3; ++c)
        variance += places_.normal[one.taxel][c] * places_.normal[one.taxel][c] * one.variance[c];
    return variance;
}

void Contact::use_variances(const std::vector<TaxelOut>& out) noexcept {
    auto term = terms_.begin();  // both are in the order of the taxels
    for (const TaxelOut& one : out) {
        while (term != terms_.end() && term->taxel < one.taxel) ++term;
        if (term == terms_.end() || term->taxel != one.taxel) continue;
        term->variance = double(along_normal(one));
        predicted_N_ += std::sqrt(term->variance);
    }
}

// The error of a doubted taxel adds to its variance, and the errors of all of them to the wrench, as those of a line of
// taxels with one cause do.
void Contact::add_doubts(TaxelForces& forces) noexcept {
    for (Term& term : terms_) {
        const double error = double(doubts_.contradiction(press_, forces.state, term.taxel));
        if (error == 0) continue;
        forces.state[term.taxel] |= TACTILED_TAXEL_DOUBTED;
        term.variance += error * error;
        doubted_N_ += std::abs(error);
        const std::array<double, 3> r{double(places_.x[term.taxel]), double(places_.y[term.taxel]),
                                      double(places_.z[term.taxel])};
        for (std::size_t c = 0; c < 3; ++c) {
            const std::size_t a = (c + 1) % 3, b = (c + 2) % 3;
            const auto& normal = places_.normal[term.taxel];
            doubt_[c] += std::abs(error * double(normal[c]));
            doubt_[3 + c] += std::abs(error * (r[a] * double(normal[b]) - r[b] * double(normal[a])));
        }
    }
}

std::array<double, 2> Contact::within() const noexcept {
    std::array<double, 2> variance{};
    for (const Term& term : terms_) variance[0] += term.within[1], variance[1] += term.within[0];
    return variance;
}

void Contact::put_centre(tactiled_array& array) const noexcept {
    const std::array<const float*, 3> r{places_.x.data(), places_.y.data(), places_.z.data()};
    for (std::size_t c = 0; c < 3; ++c) {
        double variance = 0;
        for (const Term& term : terms_) {
            const double arm = double(r[c][term.taxel]) - centre_m_[c];
            variance += arm * arm * term.variance + term.within[c];
        }
        array.cop_S_m[c] = float(centre_m_[c]);
        array.cop_sd_m[c] = float(std::sqrt(variance) / sum_N_);
    }
}

// The direction in x y along which the second moment of the press is largest.
void Contact::put_axis(tactiled_array& array) const noexcept {
    const double z2 = -2 * std::log(kFalse), of_two = sum_N_ * double(places_.pitch_m[0]) * double(places_.pitch_m[1]) / 4;
    double difference = 0, product = 0, variance = 0;
    for (const Term& term : terms_) {
        const double x = double(places_.x[term.taxel]) - centre_m_[0], y = double(places_.y[term.taxel]) - centre_m_[1];
        difference += term.press * (x * x - y * y);
        product += term.press * 2 * x * y;
        const double r2 = x * x + y * y;
        variance += r2 * r2 * term.variance / 2 + 4 * (x * x * term.within[0] + y * y * term.within[1]);
    }
    const double squares = difference * difference + product * product;
    if (!(squares > z2 * variance) || !(squares > of_two * of_two)) return;
    array.axis_rad = float(std::atan2(product, difference) / 2);
    array.axis_sd_rad = float(std::sqrt(variance / squares) / 2);
}

}  // namespace tactiled
