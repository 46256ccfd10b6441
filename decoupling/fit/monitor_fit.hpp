// Makes the monitor of a calibration (decoupling/monitor.hpp) from its rows.
#pragma once
#include <cstddef>
#include <vector>

#include "decoupling/fit/fit.hpp"

namespace tactiled {

// Sets `calibration.monitor`; it stays empty with one channel, or with fewer than kRowsPerCoefficient rows per channel.
// `group_of_row`: rows of one group are similar (a session, a pose, a stretch of time). Each group is held out in turn, and
// both limits are 1.1 times the distance that 99.9 % of the held-out rows do not exceed, at least that of normal noise. The
// residual's covariance has room for the next session: S sessions predict it with 1 + 1 / S times their variance, in each
// channel as in the mean channel, since a tare acts on the force and leaves the zeros of the channels. Scores begin at the
// number of components; the monitor has the fewest, with products or without, whose residual shows nearly as small a change
// of a channel as any.
// With as many components as channels, all channels are scores, and there is no residual. `false_alarms` is the share of the
// rows beyond limits from the other groups. setup
void set_monitor(const Rows& rows, const std::vector<std::size_t>& group_of_row, const SessionZeros& zeros,
                 Calibration& calibration);

}  // namespace tactiled
