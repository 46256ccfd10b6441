#include "decoupling/file_format.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "config/options.hpp"

namespace tactiled {
namespace {

using namespace std::string_view_literals;

struct Format {
    std::string_view magic;  // first bytes
    std::string_view later;  // also somewhere in the first kFormatBytes bytes
    const char* name;
    const char* convert;   // "{0}" is the file
    bool is_text = false;  // the format begins with a line of text
};

#define PANDAS(read) "python3 -c \"import sys, pandas; pandas." read ".to_csv(sys.argv[1] + '.csv', index=False)\" {0}"

// The first row that fits counts.
constexpr Format kFormats[] = {
    {"PK\x03\x04"sv, ".npy"sv, "an npz archive of numpy",
     "python3 -c \"import sys, numpy; a = numpy.load(sys.argv[1]); [numpy.save(k + '.npy', a[k]) for k in a]\" {0}"},
    {"PK\x03\x04"sv, "opendocument"sv, "a table of LibreOffice", "libreoffice --headless --convert-to csv {0}"},
    {"PK\x03\x04"sv, "[Content_Types].xml"sv, "an Excel table (xlsx)", "libreoffice --headless --convert-to csv {0}"},
    {"PK\x03\x04"sv, "_rels/"sv, "an Excel table (xlsx)", "libreoffice --headless --convert-to csv {0}"},
    {"PK\x03\x04"sv, "xl/"sv, "an Excel table (xlsx)", "libreoffice --headless --convert-to csv {0}"},
    {"PK\x03\x04"sv, "docProps/"sv, "an Excel table (xlsx)", "libreoffice --headless --convert-to csv {0}"},
    {"PK"sv, ""sv, "a zip archive", "unzip {0} (an Excel table: libreoffice --headless --convert-to csv {0})"},
    {"\xD0\xCF\x11\xE0"sv, ""sv, "an Excel table (xls)", "libreoffice --headless --convert-to csv {0}"},
    {"\x89"
     "HDF"sv,
     ""sv, "HDF5 (or MATLAB 7.3)", PANDAS("read_hdf(sys.argv[1])")},
    {"MATLAB 7.3 MAT-file"sv, ""sv, "a MATLAB file (7.3)",
     "matlab -batch \"writetable(struct2table(load('{0}')), 'labelled.csv')\"", true},
    {"MATLAB 5.0 MAT-file"sv, ""sv, "a MATLAB file",
     "python3 -c \"import sys, pandas, scipy.io; m = scipy.io.loadmat(sys.argv[1]); pandas.DataFrame({{k: v.ravel() for k, "
     "v in "
     "m.items() if k[0] != '_'}}).to_csv('labelled.csv', index=False)\" {0}",
     true},
    {"PAR1"sv, ""sv, "parquet", PANDAS("read_parquet(sys.argv[1])")},
    {"ARROW1"sv, ""sv, "feather (Arrow)", PANDAS("read_feather(sys.argv[1])")},
    {"FEA1"sv, ""sv, "feather (Arrow)", PANDAS("read_feather(sys.argv[1])")},
    {"\x89MCAP0"sv, ""sv, "a recording in MCAP",
     "ros2 topic echo --csv TOPIC > labelled.csv, beside ros2 bag play {0}; one that tactilectl made: tactilectl replay {0} "
     "--out "
     "forces.csv"},
    {"#ROSBAG V"sv, ""sv, "a rosbag of ROS 1", "rostopic echo -b {0} -p TOPIC > labelled.csv", true},
    {"SQLite format 3"sv, ""sv, "SQLite (a bag of ROS 2?)",
     "ros2 topic echo --csv TOPIC > labelled.csv, beside ros2 bag play {0}; another one: sqlite3 -header -csv {0} 'SELECT * "
     "FROM TABLE' > labelled.csv"},
    {"\x80\x03"sv, ""sv, "a pickle of Python", PANDAS("read_pickle(sys.argv[1])")},
    {"\x80\x04"sv, ""sv, "a pickle of Python", PANDAS("read_pickle(sys.argv[1])")},
    {"\x80\x05"sv, ""sv, "a pickle of Python", PANDAS("read_pickle(sys.argv[1])")},
    {"TDSm"sv, ""sv, "TDMS of LabVIEW",
     "python3 -c \"import sys, nptdms; nptdms.TdmsFile(sys.argv[1]).as_dataframe().to_csv('labelled.csv', index=False)\" "
     "{0}"},
    {"\xFD"
     "7zXZ"sv,
     ""sv, "packed by xz", "xz --decompress --keep {0}"},
    {"BZh"sv, "1AY&SY"sv, "packed by bzip2", "bunzip2 --keep {0}", true},
    {"\x28\xB5\x2F\xFD"sv, ""sv, "packed by zstd", "zstd -d {0}"},
    {"\x04\x22\x4D\x18"sv, ""sv, "packed by lz4", "lz4 -d {0}"},
    {"7z\xBC\xAF"sv, ""sv, "a 7-zip archive", "7z x {0}"},
    {"Rar!"sv, ""sv, "a rar archive", "unrar x {0}"},
    {"%PDF-"sv, ""sv, "a PDF", "export the table as CSV where it was made", true},
    {"<?xml"sv, ""sv, "XML", "export the table as CSV where it was made", true},
    {"<"sv, ""sv, "HTML or XML", "export the table as CSV where it was made", true},
    {"{"sv, "\"columns\""sv, "JSON", PANDAS("read_json(sys.argv[1], orient='split')"), true},
    {"{"sv, ":{"sv, "JSON", PANDAS("read_json(sys.argv[1])"), true},
    {"{"sv, ": {"sv, "JSON", PANDAS("read_json(sys.argv[1])"), true},
    {"{"sv, ": ["sv, "JSON", PANDAS("read_json(sys.argv[1])"), true},
    {"{"sv, ""sv, "JSON in lines", PANDAS("read_json(sys.argv[1], lines=True)"), true},
    {"[{"sv, ""sv, "JSON", PANDAS("read_json(sys.argv[1])"), true},
    {"[["sv, ""sv, "JSON", PANDAS("read_json(sys.argv[1])"), true},
    {"[\n"sv, ""sv, "JSON", PANDAS("read_json(sys.argv[1])"), true},
    {"\x7F"
     "ELF"sv,
     ""sv, "a program", "name the recording"},
    {"\x89PNG"sv, ""sv, "a picture", "name the recording"},
    {"\xFF\xFE\0\0"sv, ""sv, "text in UTF-32", "iconv -f UTF-32 -t UTF-8 {0} > labelled.csv"},
    {"\0\0\xFE\xFF"sv, ""sv, "text in UTF-32", "iconv -f UTF-32 -t UTF-8 {0} > labelled.csv"},
};

#undef PANDAS

// " with the topics /skin /wrench"
std::string topics_of(std::string_view format, const std::string& path) {
    const std::vector<std::string> topics =
        format.find("MCAP") == format.npos ? std::vector<std::string>() : mcap_topics(path);
    return topics.empty() ? "" : fmt::format(" with the topics {}", fmt::join(topics, " "));
}

// A control character that stands in no text; the tabulator is the first one that does.
bool is_no_text(char c) { return static_cast<unsigned char>(c) < '\t'; }
bool is_high(char c) { return static_cast<unsigned char>(c) >= 0x7F; }

}  // namespace

std::string other_format(std::string_view first_bytes, const std::string& path) {
    const std::string_view begin = first_bytes.substr(0, kFormatBytes);
    const bool has_bytes = std::any_of(begin.begin(), begin.end(), is_no_text);
    for (const Format& format : kFormats)
        // "PAR1,PAR2" is a header: a format that does not begin with text has a byte that no text has.
        if (first_bytes.starts_with(format.magic) && first_bytes.find(format.later) != std::string_view::npos &&
            (format.is_text || has_bytes || std::any_of(format.magic.begin(), format.magic.end(), is_high)))
            return fmt::format("is {}{}, not CSV; convert it: {}", format.name, topics_of(format.name, path),
                               fmt::format(fmt::runtime(format.convert), path == "-" ? "FILE" : path));
    return "";
}

}  // namespace tactiled
