// The options of tactilectl calibrate for the certificate.
#pragma once
#include <string>
#include <vector>

#include "node/ctl/command_line.hpp"
#include "node/lab/report/certificate.hpp"

namespace tactiled::ctl {

struct CertificateOptions {
    std::string file, reference;
    std::vector<std::string> uncertainty, stated;
};

void add_certificate_options(Command verb, CertificateOptions& options);

// Return the reference, with an empty name if there are no such options, and the texts. setup: throws SetupError where an
// option is wrong, or the certificate has no reference
Reference reference_of(const CertificateOptions& options);
CertificateText certificate_text(const CertificateOptions& options);

// Checks that the reference has an uncertainty for each component that has a label. setup: throws SetupError
void check_reference(const Reference& reference, const Labelled& labelled);
// States the uncertainty of the reference in the calibration, for one standard deviation. setup
void put_reference(const Reference& reference, Calibration& calibration);

// Writes the certificate. setup: throws SaveError where the calibration states no uncertainty, or no file can be written
void save_certificate(const std::string& file, const CertificateFigures& figures, const Calibration& calibration,
                      CertificateText text);

}  // namespace tactiled::ctl
