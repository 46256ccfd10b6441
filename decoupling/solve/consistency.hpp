// The limits beyond which readings contradict each other, shared by all methods that compare redundant channels.
#pragma once

namespace tactiled {

// Readings with a residual from this value on are doubtful, in standard deviations. Pure noise exceeds 6 sigma once
// in 5e8 samples, which is once in 6 days at 1 kHz; it exceeds 4 sigma once in 16 s.
inline constexpr double kDoubtful = 6;

// Relative error of the gains, so that 1 % of a reading is not significant. The documents state 4.84 % of hysteresis and
// 0.99 % of linearity, so gains cannot be calibrated more closely. Four gauges that are off by 1 % in the worst signs make a
// residual of 2 sigma; a single gauge has to be off by about 12 % of the others' reading to reach kDoubtful.
inline constexpr double kGainError = 0.01;

// A set of channels with a larger condition number, its columns scaled to length 1, is not solved.
inline constexpr double kWorstCondition = 100;

}  // namespace tactiled
