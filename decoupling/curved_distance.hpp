// The distance of a reading from the curved surface of the calibration's rows, all channels together.
//
// The channels of a photodiode or a force-sensing resistor are a strongly curved function of the force. One covariance
// (joint_domain.hpp) contains this curvature as if it were free motion, so that a damaged channel stays inside. Here a few
// directions of the readings and their products predict all channels (fit/curved_domain_fit.cpp), and the residual is
// compared with the residuals of held-out rows. The prediction is worse where there are few rows, so the limit of the
// squared distance grows with the distance of the features from those of the rows.
#pragma once
#include <algorithm>
#include <cstddef>

#include "config/calibration.hpp"
#include "config/names.hpp"

namespace tactiled {

class CurvedDistance {
public:
    // The domain has a curved part. setup
    explicit CurvedDistance(const JointDomain& domain);

    // Returns the squared distance relative to the squared limit: above 1 the reading is outside. NaN or infinite for
    // numbers that are not finite or overflow. rt: bounded by the channels and the directions
    [[nodiscard]] double squared(const double* channel) const noexcept;

private:
    static constexpr std::size_t kMaxFeatures = curved_features(kMaxDirections) + 1;  // an even number
    static constexpr std::size_t kMaxInputs = kMaxChannels + kMaxFeatures + 4;        // padded with zeros

    std::size_t n_, n_directions_, n_features_;
    double growth_, per_limit_squared_;
    double mean_[kMaxChannels]{};
    double direction_[kMaxChannels + 4][kMaxDirections]{};  // rows: channels
    double feature_mean_[kMaxFeatures]{};
    double feature_column_[kMaxFeatures][kMaxFeatures]{};  // columns of the lower triangle
    // Columns of the whitening's lower triangle, one per channel, then one column per feature: minus the whitening times the
    // feature's coefficients.
    double column_[kMaxInputs][kMaxChannels]{};
};

}  // namespace tactiled
