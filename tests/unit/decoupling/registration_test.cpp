// Models, methods and fits are found by their entries alone: those of tests/toys like those of the product.
#include <gtest/gtest.h>

#include <random>

#include "decoupling/auto_method.hpp"
#include "decoupling/fit/fit.hpp"
#include "decoupling/method.hpp"
#include "made_by_hand.hpp"

namespace tactiled {
namespace {

using Names = std::vector<std::string>;

// 100 rows of a load cell of 0.5 mV/V a N and 0.1 mV/V at rest.
Labelled load_cell_rows() {
    Labelled labelled;
    labelled.name = "cell.csv";
    labelled.channels = {"V"};
    std::mt19937_64 random(1);
    std::normal_distribution<double> noise(0, 1e-3);
    for (int i = 0; i < 100; ++i) {
        const double press_N = 0.1 * (i % 20);
        LabelledRow row{.line = i + 2, .channel = {0.1 + 0.5 * press_N + noise(random)}, .wrench_S = kUnseen, .session = 0};
        row.wrench_S[2] = -press_N;
        labelled.rows.push_back(row);
    }
    return labelled;
}

Calibration cubic_calibration() {
    Calibration calibration;
    calibration.path = "cubic.toml";
    calibration.model = "generic";
    calibration.method = "cubic";
    calibration.channels = {"A", "B"};
    calibration.zero = {1, 0};
    calibration.components = {"fz"};
    calibration.matrix = {{2, 0}};
    calibration.sd = {0.1};
    calibration.channel_least = {-10, -10};
    calibration.channel_most = {10, 10};
    calibration.tables = {{"width", {{2, 1}}}, {"cubic", {{8, 1}}}};
    return calibration;
}

std::unique_ptr<Decoupler> make_nothing(const CalibrationData&, std::string& fault) {
    fault = "nothing";
    return nullptr;
}
void fit_nothing(const Rows&, Calibration&, std::vector<std::string>&) {}

std::string setup_error(const FitRequest& request) {
    try {
        (void)fit(load_cell_rows(), request);
    } catch (const SetupError& error) { return error.what(); }
    return "";
}

FitRequest load_cell(const std::string& method = "") {
    return {.model = "load_cell", .method = method, .serial = "", .date = "2026-03-01"};
}

void expect_says(const std::string& text, const std::vector<std::string>& parts) {
    for (const auto& part : parts) EXPECT_NE(text.find(part), std::string::npos) << part << " is not in: " << text;
}

TEST(Registration, AModelInOneFileIsListedFittedAndRun) {
    EXPECT_EQ(method_names("load_cell"), Names{"line"});
    const Calibration calibration = fit(load_cell_rows(), load_cell()).calibration;
    EXPECT_EQ(calibration.method, "line");
    EXPECT_NEAR(calibration.parameters.at("gain"), 0.5, 1e-3);
    const Estimate estimate = decouple(*make_decoupler(calibration), {0.6});
    EXPECT_EQ(estimate.quality(), TACTILED_GOOD);
    EXPECT_NEAR(estimate.wrench_S[2], -1, 3e-3);
    EXPECT_EQ(make_decoupler(calibration, "auto", 1e6)->method(), "line");
    EXPECT_STREQ(find_fit("load_cell", "line")->channels.unit, "mV/V");
}

TEST(Registration, AMethodInOneFileRunsBesideThoseOfItsModel) {
    EXPECT_EQ(method_names("generic"), (Names{"matrix", "quadratic", "cubic", "rbf", "mlp"}));
    const auto decoupler = make_decoupler(cubic_calibration());
    EXPECT_EQ(decoupler->method(), "cubic");
    // u = (1, 3) at (3, 3): 2 * 2 from the matrix, 8 + 27 from the cubes.
    EXPECT_EQ(decouple(*decoupler, {3, 3}).wrench_S[2], 4 + 8 + 27);
    // Its table is not an unknown name to another method of the model, which does not read it.
    const Estimate matrix = decouple(*make_decoupler(cubic_calibration(), "matrix"), {3, 3});
    EXPECT_EQ(matrix.wrench_S[2], 4);
    EXPECT_EQ(matrix.reasons, std::uint32_t{TACTILED_UNKNOWN_UNCERTAINTY});
}

// A name that is only listed must not run another method, as the default branch of a chain would.
TEST(Registration, EveryMethodIsTheOneOfItsName) {
    EXPECT_EQ(fault_of_methods(), "");
    EXPECT_EQ(fault_of_fits(), "");
    EXPECT_EQ(model_names(), (Names{"capacitive", "generic", "hair", "load_cell", "patch", "piezo", "table"}));
    EXPECT_EQ(method_names("table"), (Names{"linear", "signs", "matrix", "map", "nonlinear"}));
    EXPECT_EQ(method_names("hair"), (Names{"sum_diff", "matrix", "physics"}));
    EXPECT_EQ(method_names("capacitive"), (Names{"quadratic", "ratio", "overlap"}));
    EXPECT_EQ(method_names("piezo"), Names{"fused"});
    Names fitted;
    for (const FitEntry* entry : fits_of("table")) fitted.emplace_back(entry->method);
    EXPECT_EQ(fitted, (Names{"linear", "matrix", "map", "nonlinear"}));
    EXPECT_EQ(find_method("table", "fused"), nullptr);
    EXPECT_EQ(find_method("hair", "matrix")->errs_by_gain, true);
    EXPECT_EQ(find_method("table", "matrix")->errs_by_gain, false);
}

TEST(Registration, AMisspeltModelIsRefusedWithTheKnownNames) {
    Calibration calibration = cubic_calibration();
    calibration.model = "genric";
    DecouplerFault fault;
    EXPECT_EQ(make_decoupler(calibration, "", 0, fault), nullptr);
    EXPECT_EQ(fault.key, "model");
    expect_says(fault.text, {"\"genric\"",
                             "known: \"capacitive\", \"generic\", \"hair\", \"load_cell\", \"patch\", \"piezo\", \"table\"",
                             "did you mean \"generic\"?"});
    FitRequest request = load_cell();
    request.model = "load_sell";
    expect_says(setup_error(request), {"known: \"capacitive\", \"generic\"", "did you mean \"load_cell\"?"});
}

TEST(Registration, AMisspeltMethodIsRefusedWithTheKnownNames) {
    DecouplerFault fault;
    EXPECT_EQ(make_decoupler(cubic_calibration(), "qubic", 0, fault), nullptr);
    EXPECT_EQ(fault.key, "method");
    expect_says(fault.text, {"\"qubic\"", "matrix quadratic cubic rbf mlp (or auto)", "did you mean \"cubic\"?"});
    // An error in the calibration's file, whatever method the configuration selects.
    Calibration misspelt = cubic_calibration(), beside = cubic_calibration();
    misspelt.method = "qubic";
    beside.others.emplace_back(beside).method = "qubic";
    for (const Calibration& calibration : {misspelt, beside})
        for (const char* wanted : {"", "matrix", "auto"}) {
            EXPECT_EQ(make_decoupler(calibration, wanted, 10, fault), nullptr) << wanted;
            EXPECT_EQ(fault.key, "calibration") << wanted;
            expect_says(fault.text, {"cubic.toml", "matrix quadratic cubic rbf mlp", "did you mean \"cubic\"?"});
        }
}

TEST(Registration, AMisspeltFitIsRefusedWithTheKnownNames) {
    expect_says(setup_error(load_cell("lien")), {"\"lien\"", "line are (or auto: all)", "did you mean \"line\"?"});
    FitRequest request = load_cell("signs");  // a method that has no fit
    request.model = "table";
    expect_says(setup_error(request), {"linear matrix map nonlinear are (or auto: all)"});
}

TEST(Registration, TheOrderOfAListDoesNotDependOnTheOrderOfLinking) {
    const auto entry = [](const char* method, int place) {
        return MethodEntry{.model = "order", .method = method, .place = place, .make = make_nothing};
    };
    const Names expected{"first", "also_second", "second"};
    {
        const MethodEntry a = entry("first", 1), b = entry("second", 2), c = entry("also_second", 2);
        EXPECT_EQ(method_names("order"), expected);
    }
    {
        const MethodEntry c = entry("also_second", 2), b = entry("second", 2), a = entry("first", 1);
        const FitEntry y{.model = "order", .method = "second", .fit = fit_nothing};
        const FitEntry x{.model = "order", .method = "first", .fit = fit_nothing};
        EXPECT_EQ(method_names("order"), expected);
        ASSERT_EQ(fits_of("order").size(), 2u);
        EXPECT_EQ(fits_of("order").front()->method, "first");
        EXPECT_EQ(fault_of_fits(), "");
    }
    EXPECT_EQ(method_names("order"), Names{});
}

TEST(Registration, TwoEntriesOfOneNameAreFoundAtTheStart) {
    const Calibration calibration = cubic_calibration();
    {
        const MethodEntry again{.model = "table", .method = "linear", .place = 90, .make = make_nothing};
        expect_says(refusal(calibration), {"two methods \"linear\" of model \"table\""});
        expect_says(setup_error(load_cell()), {"two methods \"linear\" of model \"table\""});
    }
    {
        const FitEntry again{.model = "load_cell", .method = "line", .fit = fit_nothing};
        expect_says(setup_error(load_cell()), {"two fits of method \"line\" of model \"load_cell\""});
    }
    {
        const FitEntry of_nothing{.model = "load_cell", .method = "curve", .fit = fit_nothing};
        expect_says(setup_error(load_cell()), {"method \"curve\" of model \"load_cell\", which it has not"});
    }
    EXPECT_EQ(make_decoupler(calibration)->method(), "cubic");
}

TEST(Registration, AnUnknownParameterIsRefusedByEveryMethod) {
    for (const auto& model : model_names())
        for (const MethodEntry* method : methods_of(model)) {
            Calibration calibration;
            calibration.parameters = {{"nonsense", 1}};
            const std::string fault = CalibrationData(calibration, method->parameters, method->tables).fault();
            expect_says(fault, {"parameter nonsense is unknown"});
            calibration.parameters.clear();
            for (const Parameter& parameter : method->parameters)
                calibration.parameters[parameter.name] = parameter.max / 2 + parameter.min / 2;
            calibration.tables["nonsense"] = {{1}};
            expect_says(CalibrationData(calibration, method->parameters, method->tables).fault(),
                        {"table nonsense is unknown"});
        }
}

}  // namespace
}  // namespace tactiled
