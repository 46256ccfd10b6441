// Model "generic", method "mlp": a network with hidden layers of tanh, g(u) = L_m(tanh(L_m-1( ... tanh(L_1(u))))).
// Table layer1, layer2 ...: one row per neuron, its bias first; the last layer has one row per component.
#include <cmath>

#include "decoupling/generic/methods.hpp"

namespace tactiled {
namespace {

constexpr std::size_t kMaxNeurons = 128;  // in one layer
constexpr std::size_t kMaxLayers = 8;     // the fit makes two

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

// The sizes of a layer follow from those of the layer before it.
constexpr std::array<KnownTable, 1 + kMaxLayers> kTables{{kWidth,
                                                          {"layer1", kAnyNumber, kAnyNumber},
                                                          {"layer2", kAnyNumber, kAnyNumber, false},
                                                          {"layer3", kAnyNumber, kAnyNumber, false},
                                                          {"layer4", kAnyNumber, kAnyNumber, false},
                                                          {"layer5", kAnyNumber, kAnyNumber, false},
                                                          {"layer6", kAnyNumber, kAnyNumber, false},
                                                          {"layer7", kAnyNumber, kAnyNumber, false},
                                                          {"layer8", kAnyNumber, kAnyNumber, false}}};

std::unique_ptr<Decoupler> make(const CalibrationData& data, std::string& fault) {
    std::vector<Layer> layers;
    std::size_t inputs = data.calibration().channels.size();
    for (std::size_t l = 1; l <= kMaxLayers && data.table(kTables[l].name) != nullptr; ++l) {
        const auto* table = data.table(kTables[l].name, kAnyNumber, 1 + inputs, fault);
        if (table == nullptr) return nullptr;
        if (table->size() > kMaxNeurons) {
            fault = fmt::format("{} has {} rows; at most {}", kTables[l].name, table->size(), kMaxNeurons);
            return nullptr;
        }
        Layer layer{.inputs = inputs, .outputs = table->size(), .weight = {}};
        for (std::size_t k = 0; k < 1 + inputs; ++k)
            for (const auto& row : *table) layer.weight.push_back(row[k]);
        inputs = layer.outputs;
        layers.push_back(std::move(layer));
    }
    if (inputs != data.calibration().components.size()) {
        fault = fmt::format("the last layer has {} rows for {} components", inputs, data.calibration().components.size());
        return nullptr;
    }
    return make_generic(data, "mlp", std::make_unique<Mlp>(std::move(layers)), fault);
}

constexpr std::array<Parameter, 1> kParameters{kSeed};

const MethodEntry entry{.model = "generic",
                        .method = "mlp",
                        .place = 40,
                        .parameters = kParameters,
                        .tables = kTables,
                        .make = make,
                        .takes_fit_of = kAnyMethod};

}  // namespace
}  // namespace tactiled
