#include "decoupling/fit/gram.hpp"

#include <algorithm>
#include <array>
#include <vector>

#ifdef __x86_64__
#include <immintrin.h>
#endif

namespace tactiled {
namespace {

using Index = Eigen::Index;
using Block = Eigen::Ref<Eigen::MatrixXd, 0, Eigen::OuterStride<>>;

// A matrix of n_k x n: value (k, i) is data[k * per_k + i * per_i].
struct Strided {
    const double* data;
    Index n_k, n, per_k, per_i;
};

#ifdef __x86_64__

// A tile of the product: 12 rows in three registers of four numbers, by 4 columns. The 12 sums stay in registers.
constexpr Index kRows = 12, kColumns = 4;
constexpr Index kDepth = 256;  // values of k at once: a panel of kRows is 24 KB, in the first cache

// a[k][kRows], b[k][kColumns] -> sums[kColumns][kRows]
__attribute__((target("avx2,fma"))) void multiply(const double* a, const double* b, Index n_k, double* sums) {
    __m256d sum[kColumns][3];
#pragma GCC unroll 12
    for (Index i = 0; i < 12; ++i) sum[i / 3][i % 3] = _mm256_setzero_pd();
    for (Index k = 0; k < n_k; ++k, a += kRows, b += kColumns) {
        const __m256d first = _mm256_loadu_pd(a), second = _mm256_loadu_pd(a + 4), third = _mm256_loadu_pd(a + 8);
#pragma GCC unroll 4
        for (Index j = 0; j < kColumns; ++j) {
            const __m256d factor = _mm256_broadcast_sd(b + j);
            sum[j][0] = _mm256_fmadd_pd(first, factor, sum[j][0]);
            sum[j][1] = _mm256_fmadd_pd(second, factor, sum[j][1]);
            sum[j][2] = _mm256_fmadd_pd(third, factor, sum[j][2]);
        }
    }
#pragma GCC unroll 12
    for (Index i = 0; i < 12; ++i) _mm256_storeu_pd(sums + 4 * i, sum[i / 3][i % 3]);
}

// Copies the values of f from k on into panels of `width` columns side by side, with zeros beyond the last column.
void pack(const Strided& f, Index k, Index n_k, Index width, std::vector<double>& panels) {
    for (Index i = 0; i < f.n; ++i) {
        const double* from = f.data + k * f.per_k + i * f.per_i;
        double* to = panels.data() + i / width * width * n_k + i % width;
        for (Index at = 0; at < n_k; ++at) to[at * width] = from[at * f.per_k];
    }
}

void add_by_avx2(const Strided& f, double sign, Block gram) {
    const auto size = std::size_t((f.n + kRows - 1) / kRows * kRows * std::min(kDepth, f.n_k));
    std::vector<double> rows(size), columns(size);
    std::array<double, std::size_t(kRows * kColumns)> sums{};
    for (Index k = 0; k < f.n_k; k += kDepth) {
        const Index n_k = std::min(kDepth, f.n_k - k);
        pack(f, k, n_k, kRows, rows);
        pack(f, k, n_k, kColumns, columns);
        for (Index j = 0; j < f.n; j += kColumns)
            for (Index i = j / kRows * kRows; i < f.n; i += kRows) {
                multiply(rows.data() + i * n_k, columns.data() + j * n_k, n_k, sums.data());
                for (Index column = j; column < std::min(f.n, j + kColumns); ++column)
                    for (Index row = std::max(i, column); row < std::min(f.n, i + kRows); ++row)
                        gram(row, column) += sign * sums[std::size_t((column - j) * kRows + row - i)];
            }
    }
}

bool has_avx2() {
    static const bool has = __builtin_cpu_supports("avx2") != 0 && __builtin_cpu_supports("fma") != 0;
    return has;
}

#else

void add_by_avx2(const Strided&, double, Block) {}
bool has_avx2() { return false; }

#endif

}  // namespace

void add_gram(const Eigen::MatrixXd& features, double sign, Eigen::MatrixXd& gram) {
    if (has_avx2())
        add_by_avx2({features.data(), features.rows(), features.cols(), 1, features.rows()}, sign, gram);
    else
        gram.selfadjointView<Eigen::Lower>().rankUpdate(features.transpose(), sign);
}

Eigen::MatrixXd solve_gram(const Eigen::MatrixXd& gram, const Eigen::MatrixXd& right) {
    constexpr Index kBlock = 128;
    const Index n = gram.rows();
    Eigen::MatrixXd lower = gram;
    for (Index at = 0; at < n; at += kBlock) {
        const Index size = std::min(kBlock, n - at), rest = n - at - size;
        Block diagonal = lower.block(at, at, size, size), below = lower.block(at + size, at, rest, size);
        const Eigen::LLT<Block> factor(diagonal);  // in place
        if (factor.info() != Eigen::Success) return dense::solve_by_ldlt(gram, right);
        if (rest == 0) break;
        diagonal.triangularView<Eigen::Lower>().transpose().solveInPlace<Eigen::OnTheRight>(below);
        Block left = lower.bottomRightCorner(rest, rest);
        if (has_avx2())
            add_by_avx2({below.data(), size, rest, n, 1}, -1, left);
        else
            left.selfadjointView<Eigen::Lower>().rankUpdate(below, -1);
    }
    Eigen::MatrixXd x = lower.triangularView<Eigen::Lower>().solve(right);
    lower.triangularView<Eigen::Lower>().transpose().solveInPlace(x);
    return x;
}

}  // namespace tactiled
