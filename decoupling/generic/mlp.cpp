// Model "generic", method "mlp": a network with hidden layers of tanh, g(u) = L_m(tanh(L_m-1( ... tanh(L_1(u))))). Table
// layer1, layer2 ...: a row a neuron, its bias first; the last layer has a row a component.
#include <cmath>

#include "decoupling/generic/methods.hpp"

namespace tactiled {
namespace {

constexpr std::size_t kMaxNeurons = 128;  // of a layer

struct Layer {
    std::size_t inputs, outputs;
    std::vector<double> weight;  // input by input, the biases first: each input adds to all neurons at once
};

class Mlp final : public Correction {
public:
    explicit Mlp(std::vector<Layer> layers) : layers_(std::move(layers)) {}
    void add(const double* u, double* out) noexcept override {
        std::array<double, kMaxNeurons> in{}, sum{};
        std::copy_n(u, layers_.front().inputs, in.begin());
        for (std::size_t l = 0; l < layers_.size(); ++l) {
            const Layer& layer = layers_[l];
            const double* weight = layer.weight.data();
            std::copy_n(weight, layer.outputs, sum.begin());
            for (std::size_t k = 0; k < layer.inputs; ++k) {
                weight += layer.outputs;
                for (std::size_t i = 0; i < layer.outputs; ++i) sum[i] += weight[i] * in[k];
            }
            if (l + 1 == layers_.size()) break;
            for (std::size_t i = 0; i < layer.outputs; ++i) in[i] = std::tanh(sum[i]);
        }
        for (std::size_t i = 0; i < layers_.back().outputs; ++i) out[i] += sum[i];
    }

private:
    std::vector<Layer> layers_;
};

}  // namespace

std::unique_ptr<Correction> make_mlp(const Calibration& calibration, std::string& fault) {
    std::vector<Layer> layers;
    std::size_t inputs = calibration.channels.size();
    for (int l = 1; l == 1 || calibration.tables.count(fmt::format("layer{}", l)) != 0; ++l) {
        const auto* table = table_of(calibration, fmt::format("layer{}", l), 0, 1 + inputs, fault);
        if (table == nullptr) return nullptr;
        if (table->size() > kMaxNeurons)
            fault = fmt::format("layer{} has {} rows; at most {}", l, table->size(), kMaxNeurons);
        Layer layer{.inputs = inputs, .outputs = table->size(), .weight = {}};
        for (std::size_t k = 0; k < 1 + inputs; ++k)
            for (const auto& row : *table) layer.weight.push_back(row[k]);
        inputs = layer.outputs;
        layers.push_back(std::move(layer));
    }
    if (fault.empty() && inputs != calibration.components.size())
        fault = fmt::format("the last layer has {} rows for {} components", inputs, calibration.components.size());
    return fault.empty() ? std::make_unique<Mlp>(std::move(layers)) : nullptr;
}

}  // namespace tactiled
