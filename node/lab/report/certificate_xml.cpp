// The certificate as XML. The order of elements is that of dcc.xsd 3.3.0 and SI_Format.xsd 2.2.1 of PTB.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <string_view>

#include "node/lab/chart/text.hpp"
#include "node/lab/report/certificate.hpp"

namespace tactiled {
namespace {

constexpr const char *kPercent = "\\percent", *kOne = "\\one", *kCelsius = "\\degreecelsius";
constexpr const char* kNotStated = "not stated";

constexpr const char* kStatements[][2] = {
    {"accreditation",
     "This certificate was made by software from a recording. It was not issued by an accredited laboratory, and it is not "
     "an "
     "accredited calibration certificate."},
    {"procedure",
     "The figures have the definitions of ISO 376:2011 where the recording has the loads for them. This is no statement "
     "that "
     "the procedure of the standard was followed, and no classification. A figure that the recording does not support is "
     "absent, with the reason."},
    {"validity",
     "The figures and uncertainties are those of published forces that are GOOD, at the loads of the calibration, just "
     "after "
     "a tare. The expanded uncertainty consists of the standard uncertainty that the calibration states from rows that were "
     "held out, and of the uncertainty of the reference; drift of the zero after the tare adds to it."},
};

// Writes elements with indentation. Texts are escaped.
class Xml {
public:
    template <typename Body>
    void in(std::string_view name, const Body& body, const std::string& attributes = "") {
        line(fmt::format("<{}{}>", name, attributes));
        ++depth_;
        body();
        --depth_;
        line(fmt::format("</{}>", name));
    }
    void leaf(std::string_view name, std::string_view text, const std::string& attributes = "") {
        line(fmt::format("<{0}{2}>{1}</{0}>", name, html_text(text), attributes));
    }
    // A text in English, as textType and richContentType have it.
    void text(std::string_view name, std::string_view text) {
        in(name, [&] { leaf("dcc:content", text, " lang=\"en\""); });
    }
    [[nodiscard]] const std::string& str() const { return text_; }

private:
    void line(const std::string& text) { text_ += std::string(2 * depth_, ' ') + text + "\n"; }

    std::string text_ = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n";
    std::size_t depth_ = 0;
};

// Returns the text in the form of notEmptyStringType: words with one blank between them.
std::string words(std::string_view text, std::string_view otherwise) {
    std::string result;
    bool is_between = false;
    for (const char c : text) {
        const bool is_blank = c == ' ' || c == '\t' || c == '\n' || c == '\r';
        if (!is_blank && is_between && !result.empty()) result += ' ';
        if (!is_blank) result += c;
        is_between = is_blank;
    }
    return result.empty() ? std::string(otherwise) : result;
}

std::string or_not_stated(const std::string& text) { return words(text, kNotStated); }

const char* unit_of(const AxisFigures& axis) { return axis.name[0] == 'f' ? "\\newton" : "\\newton\\metre"; }

void real(Xml& xml, double value, const char* unit, double expanded = kNaN) {
    xml.in("si:real", [&] {
        xml.leaf("si:value", fmt::format("{}", value));
        xml.leaf("si:unit", unit);
        if (!std::isfinite(expanded)) return;
        xml.in("si:measurementUncertaintyUnivariate", [&] {
            xml.in("si:expandedMU", [&] {
                xml.leaf("si:valueExpandedMU", fmt::format("{}", expanded));
                xml.leaf("si:coverageFactor", fmt::format("{}", kCoverage));
                xml.leaf("si:coverageProbability", "0.95");
                xml.leaf("si:distribution", "normal");
            });
        });
    });
}

void list(Xml& xml, const std::vector<double>& values, const char* unit, const std::vector<double>& expanded = {}) {
    xml.in("si:realListXMLList", [&] {
        xml.leaf("si:valueXMLList", fmt::format("{}", fmt::join(values, " ")));
        xml.leaf("si:unitXMLList", unit);
        if (expanded.empty()) return;
        xml.in("si:measurementUncertaintyUnivariateXMLList", [&] {
            xml.in("si:expandedMUXMLList", [&] {
                xml.leaf("si:valueExpandedMUXMLList", fmt::format("{}", fmt::join(expanded, " ")));
                xml.leaf("si:coverageFactorXMLList", fmt::format("{}", kCoverage));
                xml.leaf("si:coverageProbabilityXMLList", "0.95");
                xml.leaf("si:distributionXMLList", "normal");
            });
        });
    });
}

template <typename Value>
void quantity(Xml& xml, std::string_view name, const Value& value, const char* element = "dcc:quantity") {
    xml.in(element, [&] {
        xml.text("dcc:name", name);
        value();
    });
}

// ---- The parts in the order of the schema

void software(Xml& xml) {
    xml.in("dcc:dccSoftware", [&] {
        xml.in("dcc:software", [&] {
            xml.text("dcc:name", "tactiled");
            xml.leaf("dcc:release", TACTILED_VERSION);
        });
    });
}

void core_data(Xml& xml, const Calibration& calibration, const CertificateText& text) {
    const std::string performed = text.performed.empty() ? calibration.date : text.performed;
    xml.in("dcc:coreData", [&] {
        xml.leaf("dcc:countryCodeISO3166_1", text.country.empty() ? "ZZ" : text.country);
        xml.leaf("dcc:usedLangCodeISO639_1", "en");
        xml.leaf("dcc:mandatoryLangCodeISO639_1", "en");
        xml.leaf("dcc:uniqueIdentifier", or_not_stated(text.number));
        xml.leaf("dcc:beginPerformanceDate", performed);
        xml.leaf("dcc:endPerformanceDate", performed);
        xml.leaf("dcc:performanceLocation", "other");
        xml.leaf("dcc:issueDate", calibration.date);
    });
}

void items(Xml& xml, const Calibration& calibration) {
    xml.in("dcc:items", [&] {
        xml.in("dcc:item", [&] {
            xml.text("dcc:name", "tactile force sensor");
            xml.text("dcc:description",
                     fmt::format("model {}, method {}, contact model {}; channels ({}): {}", calibration.model,
                                 calibration.method, or_not_stated(calibration.contact_model),
                                 or_not_stated(calibration.channel_unit), fmt::join(calibration.channels, ", ")));
            xml.in("dcc:identifications", [&] {
                xml.in("dcc:identification", [&] {
                    xml.leaf("dcc:issuer", "other");
                    xml.leaf("dcc:value", or_not_stated(calibration.serial));
                    xml.text("dcc:name", "serial number");
                });
            });
        });
    });
}

void contact(Xml& xml, const char* element, const std::string& name, const std::string& country) {
    xml.in(element, [&] {
        xml.text("dcc:name", or_not_stated(name));
        xml.in("dcc:location", [&] {
            if (country.empty())
                xml.text("dcc:further", kNotStated);
            else
                xml.leaf("dcc:countryCode", country);
        });
    });
}

void statements(Xml& xml, const CertificateFigures& figures, const CertificateText& text) {
    const auto statement = [&](std::string_view name, std::string_view declaration) {
        xml.in("dcc:statement", [&] {
            xml.text("dcc:name", name);
            xml.text("dcc:declaration", declaration);
        });
    };
    xml.in("dcc:statements", [&] {
        for (const auto& [name, declaration] : kStatements) statement(name, declaration);
        if (figures.sessions.size() < 2)
            statement("mounting",
                      "The recording has one session, so that the uncertainty does not include another mounting.");
        if (text.country.empty()) statement("country", "The country of the laboratory was not stated; ZZ is no country.");
        if (text.performed.empty())
            statement("dates", "The date of the measurement was not stated; the dates are those of the evaluation.");
    });
}

void reference(Xml& xml, const Reference& reference) {
    const auto part = [&](const char* name, double value, const char* unit) {
        if (value > 0)
            quantity(
                xml, name, [&] { real(xml, value, unit); }, "dcc:measuringEquipmentQuantity");
    };
    xml.in("dcc:measuringEquipments", [&] {
        xml.in("dcc:measuringEquipment", [&] {
            xml.text("dcc:name", reference.name);
            xml.in("dcc:measuringEquipmentQuantities", [&] {
                part("expanded uncertainty (k = 2) of forces and moments, relative to the load", 100 * reference.relative,
                     kPercent);
                part("expanded uncertainty (k = 2) of forces", reference.force_N, "\\newton");
                part("expanded uncertainty (k = 2) of moments", reference.moment_Nm, "\\newton\\metre");
            });
        });
    });
}

void conditions(Xml& xml, const CertificateFigures& figures) {
    const auto condition = [&](const char* name, double value) {
        xml.in("dcc:influenceCondition", [&] {
            xml.text("dcc:name", name);
            xml.in("dcc:data", [&] {
                quantity(xml, name, [&] {
                    if (std::isfinite(value))
                        real(xml, value, kCelsius);
                    else
                        xml.text("dcc:noQuantity", "absent: no row with a label has a temperature");
                });
            });
        });
    };
    xml.in("dcc:influenceConditions", [&] {
        condition("lowest temperature", figures.lowest_C);
        condition("highest temperature", figures.highest_C);
    });
}

void recording(Xml& xml, const CertificateFigures& figures) {
    const auto data = [&](std::string_view name, const auto& value) {
        xml.in("dcc:metaData", [&] {
            xml.text("dcc:name", name);
            xml.in("dcc:data", value);
        });
    };
    const auto rows = [&](std::string_view name, std::size_t n) {
        data(name, [&] { quantity(xml, name, [&] { real(xml, double(n), kOne); }); });
    };
    xml.in("dcc:measurementMetaData", [&] {
        data("recording", [&] { xml.text("dcc:text", figures.recording); });
        data("sessions, each a mounting", [&] {
            xml.text("dcc:text", figures.sessions.empty() ? "one" : fmt::format("{}", fmt::join(figures.sessions, ", ")));
        });
        rows("rows with a label", figures.labelled);
        rows("rows with a label whose published force is GOOD", figures.good);
    });
}

void figure(Xml& xml, const AxisFigures& axis, std::size_t kind) {
    const LoadFigure& of = axis.figures[kind];
    const std::string name = fmt::format("{}: {}, {}", axis.name, kFigureKinds[kind].name, kFigureKinds[kind].symbol);
    const auto data = [&] {
        if (!of.absent.empty()) {
            quantity(xml, name, [&] { xml.text("dcc:noQuantity", "absent: " + of.absent); });
            return;
        }
        quantity(xml, "applied load", [&] { list(xml, of.load, unit_of(axis)); });
        if (kind == 0) {  // the only one with a mean published force
            std::vector<double> published;
            for (std::size_t i = 0; i < of.load.size(); ++i) published.push_back(of.load[i] * (1 + of.value[i]));
            quantity(xml, "published force", [&] { list(xml, published, unit_of(axis), axis.expanded_at); });
        }
        std::vector<double> percent;
        for (const double value : of.value) percent.push_back(100 * value);
        quantity(xml, name, [&] { list(xml, percent, kPercent); });
    };
    xml.in(
        "dcc:result",
        [&] {
            xml.text("dcc:name", name);
            xml.in("dcc:data", data);
        },
        fmt::format(" id=\"{}.{}\"", axis.name, kFigureKinds[kind].id));
}

void results(Xml& xml, const AxisFigures& axis, const Calibration& calibration) {
    const std::string about = "largest load of the calibration, with the uncertainty of a published force there";
    xml.in("dcc:measurementResult", [&] {
        xml.text("dcc:name", axis.name);
        xml.text("dcc:description", "held out for the standard uncertainty: " + calibration.validation);
        xml.in("dcc:results", [&] {
            xml.in(
                "dcc:result",
                [&] {
                    xml.text("dcc:name", fmt::format("{}: expanded uncertainty at full scale", axis.name));
                    xml.in("dcc:data",
                           [&] { quantity(xml, about, [&] { real(xml, axis.full_scale, unit_of(axis), axis.expanded); }); });
                },
                fmt::format(" id=\"{}.full_scale\"", axis.name));
            for (std::size_t kind = 0; kind < kFigureKinds.size(); ++kind) figure(xml, axis, kind);
        });
    });
}

void measurement_results(Xml& xml, const CertificateFigures& figures, const Calibration& calibration) {
    xml.in("dcc:measurementResults", [&] {
        xml.in("dcc:usedMethods", [&] {
            xml.in("dcc:usedMethod", [&] {
                xml.text("dcc:name", "comparison with a reference under held loads");
                xml.leaf("dcc:reference", "definitions of ISO 376:2011");
            });
        });
        reference(xml, figures.reference);
        conditions(xml, figures);
        recording(xml, figures);
        for (const AxisFigures& axis : figures.axes) results(xml, axis, calibration);
    });
}

}  // namespace

std::string certificate_xml(const CertificateFigures& figures, const Calibration& calibration, const CertificateText& text) {
    Xml xml;
    const auto body = [&] {
        xml.in("dcc:administrativeData", [&] {
            software(xml);
            core_data(xml, calibration, text);
            items(xml, calibration);
            xml.in("dcc:calibrationLaboratory", [&] { contact(xml, "dcc:contact", text.laboratory, text.country); });
            xml.in("dcc:respPersons", [&] {
                xml.in("dcc:respPerson",
                       [&] { xml.in("dcc:person", [&] { xml.text("dcc:name", or_not_stated(text.person)); }); });
            });
            contact(xml, "dcc:customer", text.customer, "");
            statements(xml, figures, text);
        });
        measurement_results(xml, figures, calibration);
    };
    xml.in("dcc:digitalCalibrationCertificate", body,
           " xmlns:dcc=\"https://ptb.de/dcc\" xmlns:si=\"https://ptb.de/si\" "
           "xmlns:xsi=\"http://www.w3.org/2001/XMLSchema-instance\" "
           "xsi:schemaLocation=\"https://ptb.de/dcc https://ptb.de/dcc/v3.3.0/dcc.xsd\" schemaVersion=\"3.3.0\"");
    return xml.str();
}

}  // namespace tactiled
