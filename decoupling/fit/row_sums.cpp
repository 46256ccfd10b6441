#include "decoupling/fit/row_sums.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <map>
#include <utility>

#include "decoupling/fit/gram.hpp"
#include "decoupling/fit/groups.hpp"
#include "decoupling/fit/parallel.hpp"

namespace tactiled {
namespace {

constexpr std::size_t kParts = 5;
constexpr Eigen::Index kChunk = 256;  // rows whose features are in memory at once: 4.6 MB with 1,136 features

// The part in which a row is left out, 0 .. kParts - 1, as in the validation but in fewer parts; and 1 if the row is in the
// last third of the time.
using Cell = std::pair<std::size_t, std::size_t>;

// Copies of a row with random zeros stay together.
std::vector<Cell> cells_of(const Rows& rows) {
    Labelled sessions;
    Rows once;
    for (const auto* row : rows) {
        if (row->session >= sessions.sessions.size()) sessions.sessions.resize(row->session + 1);
        if (once.empty() || row->line != once.back()->line) once.push_back(row);
    }
    const std::vector<Groups> ways = ways_to_hold_out(sessions, once, false);
    const auto in_time = std::find_if(ways.begin(), ways.end(), [](const Groups& way) { return way.are_in_time; });
    const std::vector<std::size_t>& group = ways.front().of_row;
    std::vector<std::size_t> known;
    std::vector<Cell> cells;
    std::size_t at = 0;
    for (const auto* row : rows) {
        if (row->line != once[at]->line) ++at;
        const auto found = std::find(known.begin(), known.end(), group[at]);
        cells.emplace_back(std::size_t(found - known.begin()) % kParts, in_time == ways.end() ? 0 : in_time->of_row[at]);
        if (found == known.end()) known.push_back(group[at]);
    }
    if (known.size() < 2)  // rows without line numbers
        for (std::size_t i = 0; i < rows.size(); ++i) cells[i] = {i * kParts / rows.size(), 0};
    return cells;
}

bool is_same(double a, double b) { return a == b || (std::isnan(a) && std::isnan(b)); }

// Returns true if both are the same row; `some` may lack a label.
bool is_same_row(const LabelledRow& known, const LabelledRow& some) {
    for (std::size_t c = 0; c < known.wrench_S.size(); ++c)
        if (!std::isnan(some.wrench_S[c]) && !is_same(known.wrench_S[c], some.wrench_S[c])) return false;
    return known.line == some.line && known.session == some.session && known.channel == some.channel;
}

}  // namespace

void Normal::add(const Eigen::MatrixXd& features, const Eigen::MatrixXd& y, double sign) {
    add_gram(features, sign, gram);
    feature_y.noalias() += sign * (features.transpose() * y);
    rows += sign * double(features.rows());
}

void Normal::add(const Normal& other, double sign) {
    gram += sign * other.gram;
    feature_y += sign * other.feature_y;
    rows += sign * other.rows;
}

Eigen::MatrixXd Normal::solve(const Eigen::MatrixXd& right, double ridge) const {
    Eigen::MatrixXd regular = gram;
    regular.diagonal().array() += ridge * rows;
    return solve_gram(regular, right);
}

RowSums::RowSums(const Rows& rows, const Scaled& scaled, FeaturesOf features_of)
    : u_(scaled.u),
      y_(units_left(scaled)),
      known_(Eigen::MatrixXd::Zero(y_.rows(), y_.cols())),
      unit_(y_.cols()),
      features_of_(std::move(features_of)),
      n_features_(features_of_(u_.topRows(1)).cols()) {
    for (const auto* row : rows) rows_.push_back(*row);
    for (Eigen::Index c = 0; c < y_.cols(); ++c) {
        unit_[c] = unit_of(scaled.component[std::size_t(c)]);
        for (const Eigen::Index i : scaled.component[std::size_t(c)].rows) known_(i, c) = 1;
    }
    const std::vector<Cell> cells = cells_of(rows);
    std::map<Cell, Places> places;
    for (std::size_t i = 0; i < cells.size(); ++i) places[cells[i]].push_back(Eigen::Index(i));
    for (auto& [cell, at] : places) {
        if (blocks_.empty() || blocks_.back().part != cell.first) begin_.push_back(Eigen::Index(sorted_.size()));
        sorted_.insert(sorted_.end(), at.begin(), at.end());
        blocks_.push_back({.part = cell.first, .places = std::move(at), .normal = none()});
    }
    begin_.push_back(Eigen::Index(sorted_.size()));
    in_parallel(blocks_.size(), [&](std::size_t i) { add(blocks_[i].places, blocks_[i].normal, 1); });
}

void RowSums::add(const Places& places, Normal& normal, double sign) const {
    const auto n = Eigen::Index(places.size());
    for (Eigen::Index begin = 0; begin < n; begin += kChunk) {
        const Eigen::Index end = std::min(n, begin + kChunk);
        const Places some(places.begin() + begin, places.begin() + end);
        normal.add(features_of_(u_(some, Eigen::all)), y_(some, Eigen::all), sign);
    }
}

std::optional<RowSums::Places> RowSums::places_of(const Rows& some) const {
    Places places;
    std::size_t at = 0;
    for (const auto* row : some) {
        while (at < rows_.size() && !is_same_row(rows_[at], *row)) ++at;
        if (at == rows_.size()) return std::nullopt;
        places.push_back(Eigen::Index(at++));
    }
    return places;
}

Normal RowSums::of(const Places& places) const {
    std::vector<bool> used(rows_.size());
    for (const Eigen::Index i : places) used[std::size_t(i)] = true;
    Normal sum = none();
    Places in, out;  // rows that the sums of whole blocks lack, or have in excess
    for (const Block& block : blocks_) {
        const auto is_used = [&](Eigen::Index i) { return bool(used[std::size_t(i)]); };
        const auto n_used = std::count_if(block.places.begin(), block.places.end(), is_used);
        if (2 * std::size_t(n_used) > block.places.size()) {
            sum.add(block.normal);
            std::remove_copy_if(block.places.begin(), block.places.end(), std::back_inserter(out), is_used);
        } else {
            std::copy_if(block.places.begin(), block.places.end(), std::back_inserter(in), is_used);
        }
    }
    add(in, sum, 1);
    add(out, sum, -1);
    return sum;
}

void RowSums::take_out(const Places& places, Normal& normal) const { add(places, normal, -1); }

Normal RowSums::of_part(std::size_t part) const {
    Normal sum = none();
    for (const Block& block : blocks_)
        if (block.part == part) sum.add(block.normal);
    return sum;
}

Eigen::MatrixXd RowSums::u_of(Eigen::Index begin, Eigen::Index end) const {
    return u_(Places(sorted_.begin() + begin, sorted_.begin() + end), Eigen::all);
}

Eigen::MatrixXd RowSums::y_of(Eigen::Index begin, Eigen::Index end) const {
    return y_(Places(sorted_.begin() + begin, sorted_.begin() + end), Eigen::all);
}

Eigen::MatrixXd RowSums::known_of(Eigen::Index begin, Eigen::Index end) const {
    return known_(Places(sorted_.begin() + begin, sorted_.begin() + end), Eigen::all);
}

}  // namespace tactiled
