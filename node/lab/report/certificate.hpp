// The certificate of a calibration. One structure has the figures (decoupling/fit/certificate.hpp), and two writers show it:
// a section of the report, and a file for machines.
#pragma once
#include <array>
#include <string>

#include "decoupling/fit/certificate.hpp"

namespace tactiled {

// Texts of the certificate that no recording has; "" = not stated.
struct CertificateText {
    std::string number, laboratory, person, customer;
    std::string country;    // the laboratory's, ISO 3166-1, two letters
    std::string performed;  // date of the measurement, YYYY-MM-DD
};

// Returns the section of the report. A figure that is absent has its reason. setup
std::string html_certificate(const CertificateFigures& figures);

// Returns the certificate as XML in the shape of PTB's Digital Calibration Certificate 3.3.0, with quantities of D-SI 2.2.1.
// Each number has all its digits; the same input gives the same bytes. `calibration` has an expanded uncertainty for each
// component, and the number is stated. setup
std::string certificate_xml(const CertificateFigures& figures, const Calibration& calibration,
                            const CertificateText& stated);

}  // namespace tactiled
