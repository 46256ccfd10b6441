// The certificate as XML. The order of elements is that of dcc.xsd 3.3.0 and SI_Format.xsd 2.2.1 of PTB.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <string_view>

#include "node/lab/chart/text.hpp"
#include "node/lab/report/certificate.hpp"

namespace tactiled {
namespace {

constexpr const char* kNotStated = "not stated";

// Names in braces are texts that are escaped already.
constexpr const char* kAdministrative = R"(<?xml version="1.0" encoding="UTF-8"?>
<dcc:digitalCalibrationCertificate xmlns:dcc="https://ptb.de/dcc" xmlns:si="https://ptb.de/si"
    xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance"
    xsi:schemaLocation="https://ptb.de/dcc https://ptb.de/dcc/v3.3.0/dcc.xsd" schemaVersion="3.3.0">
<dcc:administrativeData>
  <dcc:dccSoftware>
    <dcc:software>
      <dcc:name><dcc:content lang="en">tactiled</dcc:content></dcc:name>
      <dcc:release>{version}</dcc:release>
    </dcc:software>
  </dcc:dccSoftware>
  <dcc:coreData>
    <dcc:countryCodeISO3166_1>{country}</dcc:countryCodeISO3166_1>
    <dcc:usedLangCodeISO639_1>en</dcc:usedLangCodeISO639_1>
    <dcc:mandatoryLangCodeISO639_1>en</dcc:mandatoryLangCodeISO639_1>
    <dcc:uniqueIdentifier>{number}</dcc:uniqueIdentifier>
    <dcc:beginPerformanceDate>{performed}</dcc:beginPerformanceDate>
    <dcc:endPerformanceDate>{performed}</dcc:endPerformanceDate>
    <dcc:performanceLocation>other</dcc:performanceLocation>
    <dcc:issueDate>{issued}</dcc:issueDate>
  </dcc:coreData>
  <dcc:items>
    <dcc:item>
      <dcc:name><dcc:content lang="en">tactile force sensor</dcc:content></dcc:name>
      <dcc:description><dcc:content lang="en">{item}</dcc:content></dcc:description>
      <dcc:identifications>
        <dcc:identification>
          <dcc:issuer>other</dcc:issuer>
          <dcc:value>{serial}</dcc:value>
          <dcc:name><dcc:content lang="en">serial number</dcc:content></dcc:name>
        </dcc:identification>
      </dcc:identifications>
    </dcc:item>
  </dcc:items>
  <dcc:calibrationLaboratory>
    <dcc:contact>
      <dcc:name><dcc:content lang="en">{laboratory}</dcc:content></dcc:name>
      <dcc:location><dcc:countryCode>{country}</dcc:countryCode></dcc:location>
    </dcc:contact>
  </dcc:calibrationLaboratory>
  <dcc:respPersons>
    <dcc:respPerson>
      <dcc:person><dcc:name><dcc:content lang="en">{person}</dcc:content></dcc:name></dcc:person>
    </dcc:respPerson>
  </dcc:respPersons>
  <dcc:customer>
    <dcc:name><dcc:content lang="en">{customer}</dcc:content></dcc:name>
    <dcc:location><dcc:further><dcc:content lang="en">not stated</dcc:content></dcc:further></dcc:location>
  </dcc:customer>
  <dcc:statements>
{statements}  </dcc:statements>
</dcc:administrativeData>
)";

constexpr const char* kResults = R"(<dcc:measurementResults>
  <dcc:usedMethods>
    <dcc:usedMethod>
      <dcc:name><dcc:content lang="en">comparison with a reference under held loads</dcc:content></dcc:name>
      <dcc:reference>definitions of ISO 376:2011</dcc:reference>
    </dcc:usedMethod>
  </dcc:usedMethods>
  <dcc:measuringEquipments>
    <dcc:measuringEquipment>
      {reference}
      <dcc:measuringEquipmentQuantities>
{uncertainties}      </dcc:measuringEquipmentQuantities>
    </dcc:measuringEquipment>
  </dcc:measuringEquipments>
  <dcc:influenceConditions>
{conditions}  </dcc:influenceConditions>
  <dcc:measurementMetaData>
{recording}  </dcc:measurementMetaData>
{results}</dcc:measurementResults>
</dcc:digitalCalibrationCertificate>
)";

constexpr const char* kAccreditation =
    "This certificate was made by software from a recording. It was not issued by an accredited laboratory, and it is not "
    "an "
    "accredited calibration certificate.";
constexpr const char* kProcedure =
    "The figures have the definitions of ISO 376:2011 where the recording has the loads for them. A load is held if three "
    "labels or more in turn agree within 1 % of full scale; the standard waits for 30 s. This is no statement that the "
    "procedure of the standard was followed, and no classification. A figure that the recording does not support is absent, "
    "with the reason.";
constexpr const char* kValidity =
    "The figures and uncertainties are those of published forces that are GOOD, at the loads of the calibration, just after "
    "a "
    "tare. The expanded uncertainty consists of the standard uncertainty that the calibration states from rows that were "
    "held "
    "out, and of the uncertainty of the reference; drift of the zero after the tare adds to it.";

// Returns an escaped text in the form of notEmptyStringType: words with one blank between them.
std::string words(std::string_view text) {
    std::string result;
    bool is_between = false;
    for (const char c : text) {
        const bool is_blank = c == ' ' || c == '\t' || c == '\n' || c == '\r';
        if (!is_blank && is_between && !result.empty()) result += ' ';
        if (!is_blank) result += c;
        is_between = is_blank;
    }
    return html_text(result.empty() ? kNotStated : result);
}

// Returns an element with a text in English, as textType and richContentType have it.
std::string text(const char* element, std::string_view plain) {
    return fmt::format("<{0}><dcc:content lang=\"en\">{1}</dcc:content></{0}>", element, html_text(plain));
}
std::string name(std::string_view plain) { return text("dcc:name", plain); }

std::string quantity(std::string_view plain, const std::string& value, const char* element = "dcc:quantity") {
    return fmt::format("<{0}>\n{1}\n{2}\n</{0}>\n", element, name(plain), value);
}
std::string absent(std::string_view reason) { return text("dcc:noQuantity", fmt::format("absent: {}", reason)); }

const char* unit_of(const AxisFigures& axis) { return axis.name[0] == 'f' ? "\\newton" : "\\newton\\metre"; }

// Returns si:real, or with `list` = "XMLList" si:realListXMLList. `values` and `expanded` are numbers; expanded = "": none.
std::string numbers(std::string_view values, const char* unit, std::string_view expanded, const char* list) {
    const std::string uncertainty = expanded.empty() ? ""
                                                     : fmt::format(
                                                           "<si:measurementUncertaintyUnivariate{0}><si:expandedMU{0}>\n"
                                                           "<si:valueExpandedMU{0}>{1}</si:valueExpandedMU{0}>\n"
                                                           "<si:coverageFactor{0}>{2}</si:coverageFactor{0}>\n"
                                                           "<si:coverageProbability{0}>0.95</si:coverageProbability{0}>\n"
                                                           "<si:distribution{0}>normal</si:distribution{0}>\n"
                                                           "</si:expandedMU{0}></si:measurementUncertaintyUnivariate{0}>\n",
                                                           list, expanded, kCoverage);
    return fmt::format("<si:real{4}{0}>\n<si:value{0}>{1}</si:value{0}>\n<si:unit{0}>{2}</si:unit{0}>\n{3}</si:real{4}{0}>",
                       list, values, unit, uncertainty, *list == '\0' ? "" : "List");
}
std::string real(double value, const char* unit, double expanded = kNaN) {
    return numbers(fmt::format("{}", value), unit, std::isfinite(expanded) ? fmt::format("{}", expanded) : "", "");
}
std::string real_list(const std::vector<double>& values, const char* unit, const std::vector<double>& expanded = {}) {
    return numbers(fmt::format("{}", fmt::join(values, " ")), unit, fmt::format("{}", fmt::join(expanded, " ")), "XMLList");
}

std::string statements(const CertificateFigures& figures, const CertificateText& stated) {
    std::string result;
    const auto add = [&](const char* about, const char* declaration) {
        result +=
            fmt::format("<dcc:statement>\n{}\n{}\n</dcc:statement>\n", name(about), text("dcc:declaration", declaration));
    };
    add("accreditation", kAccreditation);
    add("procedure", kProcedure);
    add("validity", kValidity);
    if (figures.sessions.size() < 2)
        add("mounting", "The recording has one session, so that the uncertainty does not include another mounting.");
    if (stated.country.empty()) add("country", "The country of the laboratory was not stated; ZZ is no country.");
    if (stated.performed.empty())
        add("dates", "The date of the measurement was not stated; the dates are those of the evaluation.");
    return result;
}

std::string uncertainties(const Reference& reference) {
    std::string result;
    const auto add = [&](const char* about, double value, const char* unit) {
        if (value > 0) result += quantity(about, real(value, unit), "dcc:measuringEquipmentQuantity");
    };
    add("expanded uncertainty (k = 2) relative to the load", 100 * reference.relative, "\\percent");
    add("expanded uncertainty (k = 2) of forces", reference.force_N, "\\newton");
    add("expanded uncertainty (k = 2) of moments", reference.moment_Nm, "\\newton\\metre");
    return result;
}

std::string condition(const char* about, double value_C) {
    const std::string value =
        std::isfinite(value_C) ? real(value_C, "\\degreecelsius") : absent("no row with a label has a temperature");
    return fmt::format("<dcc:influenceCondition>\n{}\n<dcc:data>\n{}</dcc:data>\n</dcc:influenceCondition>\n", name(about),
                       quantity(about, value));
}

std::string recording(const CertificateFigures& figures) {
    std::string result;
    const auto add = [&](const char* about, const std::string& data) {
        result += fmt::format("<dcc:metaData>\n{}\n<dcc:data>\n{}\n</dcc:data>\n</dcc:metaData>\n", name(about), data);
    };
    const auto add_rows = [&](const char* about, std::size_t n) { add(about, quantity(about, real(double(n), "\\one"))); };
    add("recording", text("dcc:text", figures.recording));
    add("sessions, each a mounting",
        text("dcc:text", figures.sessions.empty() ? "one" : fmt::format("{}", fmt::join(figures.sessions, ", "))));
    add_rows("rows with a label", figures.labelled);
    add_rows("rows with a label whose published force is GOOD", figures.good);
    return result;
}

std::string result(const AxisFigures& axis, const char* id, std::string_view plain, const std::string& data) {
    return fmt::format("<dcc:result id=\"{}.{}\">\n{}\n<dcc:data>\n{}</dcc:data>\n</dcc:result>\n", axis.name, id,
                       name(plain), data);
}

std::string figure(const AxisFigures& axis, std::size_t kind) {
    const auto& [id, symbol, of] = kFigureKinds[kind];
    const LoadFigure& figure = axis.figures[kind];
    const std::string about = fmt::format("{}: {}, {}", axis.name, of, symbol);
    if (!figure.absent.empty()) return result(axis, id, about, quantity(about, absent(figure.absent)));
    std::vector<double> percent, published;
    for (std::size_t i = 0; i < figure.value.size(); ++i) {
        percent.push_back(100 * figure.value[i]);
        published.push_back(figure.load[i] * (1 + figure.value[i]));
    }
    std::string data = quantity("applied load", real_list(figure.load, unit_of(axis)));
    if (kind == 0)  // interpolation: the only one with a mean published force
        data += quantity("published force", real_list(published, unit_of(axis), axis.expanded_at));
    return result(axis, id, about, data + quantity(about, real_list(percent, "\\percent")));
}

std::string results(const AxisFigures& axis, const Calibration& calibration) {
    std::string of_axis = result(axis, "full_scale", axis.name + ": expanded uncertainty at full scale",
                                 quantity("largest load of the calibration, with the uncertainty of a published force there",
                                          real(axis.full_scale, unit_of(axis), axis.expanded)));
    for (std::size_t kind = 0; kind < kFigureKinds.size(); ++kind) of_axis += figure(axis, kind);
    return fmt::format("<dcc:measurementResult>\n{}\n{}\n<dcc:results>\n{}</dcc:results>\n</dcc:measurementResult>\n",
                       name(axis.name),
                       text("dcc:description", "held out for the standard uncertainty: " + calibration.validation), of_axis);
}

}  // namespace

std::string certificate_xml(const CertificateFigures& figures, const Calibration& calibration,
                            const CertificateText& stated) {
    using fmt::arg;
    std::string of_axes;
    for (const AxisFigures& axis : figures.axes) of_axes += results(axis, calibration);
    const std::string item =
        fmt::format("model {}, method {}, contact model {}; channels ({}): {}", calibration.model, calibration.method,
                    calibration.contact_model, calibration.channel_unit, fmt::join(calibration.channels, ", "));
    return fmt::format(kAdministrative, arg("version", TACTILED_VERSION), arg("number", words(stated.number)),
                       arg("country", stated.country.empty() ? "ZZ" : stated.country),
                       arg("performed", stated.performed.empty() ? calibration.date : stated.performed),
                       arg("issued", calibration.date), arg("item", html_text(item)),
                       arg("serial", words(calibration.serial)), arg("laboratory", words(stated.laboratory)),
                       arg("person", words(stated.person)), arg("customer", words(stated.customer)),
                       arg("statements", statements(figures, stated))) +
           fmt::format(kResults, arg("reference", name(figures.reference.name)),
                       arg("uncertainties", uncertainties(figures.reference)),
                       arg("conditions", condition("lowest temperature", figures.lowest_C) +
                                             condition("highest temperature", figures.highest_C)),
                       arg("recording", recording(figures)), arg("results", of_axes));
}

}  // namespace tactiled
