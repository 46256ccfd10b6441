#include "node/lab/register_judge.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>

namespace tactiled::ctl {
namespace {

struct NumberFormat {
    const char* name;
    std::size_t words;
    bool is_signed, is_float;
    int digits;  // mantissa, binary
};
constexpr NumberFormat kFormats[] = {
    {"int16", 1, true, false, 15},   {"uint16", 1, false, false, 16}, {"int32", 2, true, false, 31},
    {"uint32", 2, false, false, 32}, {"float32", 2, true, true, 24},  {"float64", 4, true, true, 53},
};
const NumberFormat& format_of(NumberType type) { return kFormats[std::size_t(type)]; }

// Usual magnitudes of a float are 1e-4 .. 1e6: forces and torques of a fingertip up to counts of a converter.
constexpr int kMinExponent = -13, kMaxExponent = 20;
// A type that is not plausible, or a false winner, has a probability of one in a million.
constexpr double kRareBits = 20;
// An adaptive code loses up to half a bit per row against the best one for the noise of a sensor.
constexpr double kLossBits = 0.5;

// Fixed-point numbers are floats that are multiples of a step.
struct Number {
    double value = 0, step = 0;  // step: of the format at this value
};

Number number_of(const std::uint16_t* words, const Interpretation& as) {
    const NumberFormat& format = format_of(as.type);
    std::uint64_t bits = 0;
    for (std::size_t i = 0; i < format.words; ++i) {
        const std::uint16_t word = words[as.low_word_first ? format.words - 1 - i : i];
        bits = bits << 16 | (as.low_byte_first ? std::uint16_t(word << 8 | word >> 8) : word);
    }
    double value = 0;
    switch (as.type) {
        case NumberType::int16: value = std::int16_t(bits); break;
        case NumberType::int32: value = std::int32_t(bits); break;
        case NumberType::float32: value = double(std::bit_cast<float>(std::uint32_t(bits))); break;
        case NumberType::float64: value = std::bit_cast<double>(bits); break;
        default: value = double(bits);
    }
    if (!format.is_float) return {value, 1};
    if (value == 0 || !std::isfinite(value)) return {value, 0};
    return {value, std::exp2(std::ilogb(value) - format.digits + 1)};
}

// Returns the largest power of two that divides all values, or the decimal step to which they are rounded, because many
// devices send few digits. 1 if all are 0.
double common_step(const std::vector<Number>& numbers) {
    double step = std::numeric_limits<double>::infinity();
    for (const Number& number : numbers) {
        if (number.value == 0) continue;
        int exponent = 0;
        const auto mantissa = std::uint64_t(std::abs(std::ldexp(std::frexp(number.value, &exponent), 53)));
        step = std::min(step, std::ldexp(1.0, exponent - 53 + std::countr_zero(mantissa)));
    }
    if (!std::isfinite(step)) return 1;
    for (double decimal = 1; decimal > std::max(step, 1e-7); decimal /= 10)
        if (std::all_of(numbers.begin(), numbers.end(), [&](const Number& number) {
                return std::abs(std::round(number.value / decimal) * decimal - number.value) <= 0.5 * number.step;
            }))
            return decimal;
    return step;
}

// An adaptive probability of a yes, from the last twenty answers or so.
class Adaptive {
public:
    double bits(bool yes) {
        const double cost = -std::log2((yes ? yes_ : no_) / (yes_ + no_));
        yes_ = 0.5 + 0.95 * (yes_ - 0.5) + (yes ? 1 : 0);
        no_ = 0.5 + 0.95 * (no_ - 0.5) + (yes ? 0 : 1);
        return cost;
    }

private:
    double yes_ = 0.5, no_ = 0.5;  // Krichevsky and Trofimov
};

// An adaptive distribution of differences: two-sided geometric ones, whose scales are powers of four and whose weights
// follow the differences seen. The scale may change at any sample (fixed share: Herbster and Warmuth, Machine Learning 32,
// 1998), because a sensor at rest is pressed.
class Differences {
public:
    // From the largest difference down to `step`, or over 64 octaves.
    Differences(double largest, double step) {
        for (double scale = 2 * largest; scale_.size() < 32 && scale > step / 4; scale /= 4) scale_.push_back(scale);
        weight_.assign(scale_.size(), 1 / double(scale_.size()));
    }
    double bits(double difference, double step) {
        constexpr double kShare = 1.0 / 16;
        const double d = std::max(difference, step), n = double(scale_.size());
        double sum = 0;
        for (std::size_t i = 0; i < scale_.size(); ++i) {
            weight_[i] *= 0.5 * std::exp(-(d - step) / scale_[i]) * -std::expm1(-step / scale_[i]);
            sum += weight_[i];
        }
        for (double& weight : weight_) weight = (1 - kShare) * weight / sum + kShare / n;
        return -std::log2(sum);
    }

private:
    std::vector<double> scale_, weight_;
};

struct Motion {
    double bits = 0;                  // for all rows after the first
    double jump_bits = 0, jumps = 0;  // rows that differ from the previous one
};

// Codes the motion of a series from its previous value or from its running mean. Repetitions are coded apart, and with
// `recalls` also the return of an earlier value, because a quiet converter has few values.
Motion motion_of(const std::vector<Number>& numbers, double largest, double common, bool from_mean, bool recalls) {
    Adaptive repeats, returns;
    Differences differences(largest, common);
    std::vector<double> seen{numbers[0].value};
    Motion motion;
    double mean = numbers[0].value;
    for (std::size_t i = 1; i < numbers.size(); ++i) {
        const double value = numbers[i].value, previous = numbers[i - 1].value;
        motion.bits += repeats.bits(value == previous);
        if (value != previous) {
            const bool is_old = recalls && std::find(seen.begin(), seen.end(), value) != seen.end();
            double bits = recalls && seen.size() > 1 ? returns.bits(is_old) : 0;
            if (is_old)
                bits += std::log2(double(seen.size() - 1));
            else
                bits += differences.bits(std::abs(value - (from_mean ? mean : previous)), std::max(numbers[i].step, common));
            if (recalls && !is_old) seen.push_back(value);
            motion.bits += bits;
            motion.jump_bits += bits;
            ++motion.jumps;
        }
        mean += (value - mean) / 8;
    }
    return motion;
}

struct Coded {
    double bits = 0;
    bool plausible = true;
};

// Counts from the middle of the range if they are nearer to it than to 0, as those of converters with offset binary code.
void centre(std::vector<Number>& numbers, double& largest, double middle) {
    double distance = 0;
    for (const Number& number : numbers) distance = std::max(distance, std::abs(number.value - middle));
    if (distance >= largest) return;
    largest = std::max(distance, 1.0);
    for (Number& number : numbers) number.value -= middle;
}

// Codes a series as a magnitude, a first value within it, and its motion. A number that moves through nearly all values of
// its type is half of another one: each change must save 2 of its bits, or one more is charged.
Coded code(std::vector<Number> numbers, const NumberFormat& format) {
    const double rows = double(numbers.size()), bits = 16.0 * double(format.words);
    double largest = 0;
    for (const Number& number : numbers) {
        if (!std::isfinite(number.value)) return {(bits + 1) * rows + kRareBits, false};
        largest = std::max(largest, std::abs(number.value));
    }
    if (largest == 0) return {3, true};  // an axis without a signal, one in eight
    if (!format.is_signed) centre(numbers, largest, std::exp2(format.digits - 1));
    const double common = common_step(numbers);
    const int exponent = std::ilogb(largest);
    const bool usual = !format.is_float || (exponent >= kMinExponent && exponent < kMaxExponent);
    const double octaves = format.is_float ? kMaxExponent - kMinExponent : format.digits;
    const double step = std::max(numbers[0].step, common);
    const double first = std::log2(octaves * format.digits) + std::log2(std::exp2(exponent + 1) / step) + 1;
    Motion best;
    bool jumps = true;
    for (const bool recalls : {false, true})
        for (const bool from_mean : {false, true}) {
            const Motion motion = motion_of(numbers, largest, common, from_mean, recalls);
            if (best.bits == 0 || motion.bits < best.bits) best = motion;
            if (!recalls && motion.jump_bits <= (bits - 2) * motion.jumps + kRareBits) jumps = false;
        }
    const double all = std::min(first + 2 + best.bits, bits * rows);
    return {all + (usual ? 0 : kRareBits) + (jumps ? kRareBits + 3 * best.jumps : 0), usual && !jumps};
}

class Judge {
public:
    Judge(const RegisterRows& answers) : first_(answers.first) {
        for (const auto& row : answers.rows)
            if (rows_.empty() || rows_.back() != row) rows_.push_back(row);
        Interpretation word;
        for (std::size_t at = 0; at < rows_.front().size(); ++at) {
            word_bits_.push_back(16.0 * double(rows_.size()));
            for (const bool low_byte_first : {false, true}) {
                word.low_byte_first = low_byte_first;
                word_bits_[at] = std::min(word_bits_[at], code(series(word, at), format_of(word.type)).bits);
            }
        }
    }

    // False: the rows do not hold these registers.
    bool judge(Interpretation& as, std::size_t n) const {
        const std::size_t words = format_of(as.type).words, width = rows_.front().size();
        if (as.at < first_ || std::size_t(as.at - first_) + n * words > width) return false;
        const std::size_t begin = as.at - first_, end = begin + n * words;
        for (std::size_t at = 0; at < width; ++at)
            if (at < begin || at >= end) as.bits += word_bits_[at];
        for (std::size_t at = begin; at < end; at += words) {
            const auto numbers = series(as, at);
            const Coded coded = code(numbers, format_of(as.type));
            as.bits += coded.bits;
            as.plausible = as.plausible && coded.plausible;
            auto& values = as.numbers.emplace_back();
            for (const Number& number : numbers) values.push_back(number.value);
        }
        return true;
    }

private:
    [[nodiscard]] std::vector<Number> series(const Interpretation& as, std::size_t at) const {
        std::vector<Number> numbers;
        for (const auto& row : rows_) numbers.push_back(number_of(&row[at], as));
        return numbers;
    }
    std::uint16_t first_;
    std::vector<std::vector<std::uint16_t>> rows_;
    std::vector<double> word_bits_;  // each register that belongs to no number, in any order of bytes
};

// True if the numbers differ by constants, as those of a signed and of an unsigned integer that do not cross 0.
bool moves_alike(const Interpretation& a, const Interpretation& b) {
    for (std::size_t k = 0; k < a.numbers.size(); ++k)
        for (std::size_t i = 0; i < a.numbers[k].size(); ++i)
            if (a.numbers[k][i] - a.numbers[k][0] != b.numbers[k][i] - b.numbers[k][0]) return false;
    return true;
}

}  // namespace

const char* name_of(NumberType type) { return format_of(type).name; }
std::size_t words_of(NumberType type) { return format_of(type).words; }

std::string Interpretation::text() const {
    const bool one_word = format_of(type).words == 1;
    return fmt::format("{}{}{}, at {}", name_of(type),
                       one_word         ? ""
                       : low_word_first ? ", low_first"
                                        : ", high_first",
                       low_byte_first ? ", bytes swapped" : "", at);
}

std::vector<Interpretation> judge_registers(const RegisterRows& answers, std::uint16_t at, std::size_t count) {
    const Judge judge(answers);
    std::vector<Interpretation> ranked;
    for (const bool low_byte_first : {false, true})
        for (const bool low_word_first : {false, true})
            for (std::size_t type = 0; type < std::size(kFormats); ++type)
                for (const int shift : {0, -1, 1}) {
                    const std::size_t words = kFormats[type].words;
                    // the registers alone do not show the place of the first of several numbers of one word
                    if ((words == 1 && (shift != 0 || low_word_first)) || (at == 0 && shift < 0)) continue;
                    Interpretation one{.type = NumberType(type),
                                       .low_word_first = low_word_first,
                                       .low_byte_first = low_byte_first,
                                       .at = std::uint16_t(at + shift),
                                       .numbers = {}};
                    if (judge.judge(one, std::max<std::size_t>(1, count / words))) ranked.push_back(std::move(one));
                }
    std::stable_sort(ranked.begin(), ranked.end(), [](const auto& a, const auto& b) { return a.bits < b.bits; });
    return ranked;
}

std::vector<std::size_t> equals(const std::vector<Interpretation>& ranked) {
    std::vector<std::size_t> found;
    for (std::size_t i = 0; i < ranked.size(); ++i) {
        const Interpretation &best = ranked[0], &one = ranked[i];
        const bool same_order = one.low_word_first == best.low_word_first && one.low_byte_first == best.low_byte_first &&
                                words_of(one.type) == words_of(best.type);
        // the next block of equal numbers is no worse, because of other registers beside it
        const bool is_beside = same_order && one.type == best.type && one.plausible &&
                               std::size_t(std::abs(one.at - best.at)) % words_of(one.type) == 0;
        // the codes of two types of the same bits lose the same
        const double loss = same_order && one.at == best.at ? 0 : kLossBits * double(best.numbers[0].size());
        const bool is_alike = same_order && one.at == best.at && one.plausible && moves_alike(one, best);
        if (is_beside || is_alike || one.bits < best.bits + kRareBits + loss) found.push_back(i);
    }
    return found;
}

bool is_clear(const std::vector<Interpretation>& ranked) {
    return !ranked.empty() && equals(ranked).size() == 1 && ranked[0].plausible &&
           double(ranked[0].numbers[0].size()) >= kRareBits;  // one bit per row may be by chance
}

}  // namespace tactiled::ctl
