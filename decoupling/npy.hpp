// The file format .npy of numpy (NEP 1) as lines of CSV: a structured array with its names, or a 2-D array of numbers, whose
// columns have no names.
#pragma once
#include <memory>
#include <string>

#include "decoupling/text_lines.hpp"

namespace tactiled {

// `first` are the bytes already read from `packed`. setup: throws SetupError where the array is of another kind
std::unique_ptr<Bytes> npy_as_text(std::unique_ptr<Bytes> packed, std::string first, const std::string& name);

}  // namespace tactiled
