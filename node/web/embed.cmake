# cmake -D OUT=assets.cpp -D FOLDER=page -D "LIST=/=index.html=text/html|..." -P embed.cmake: files as arrays of bytes.
set(arrays "")
set(entries "")
set(n 0)
string(REPLACE "|" ";" LIST "${LIST}")
foreach(entry ${LIST})
    string(REPLACE "=" ";" parts "${entry}")
    list(GET parts 0 path)
    list(GET parts 1 file)
    list(GET parts 2 type)
    file(READ ${FOLDER}/${file} hex HEX)
    string(APPEND contents "${hex}")
    string(REGEX REPLACE "([0-9a-f][0-9a-f])" "0x\\1," bytes "${hex}")
    string(APPEND arrays "const unsigned char bytes${n}[] = {${bytes}};\n")
    string(APPEND entries
        "        {\"${path}\", \"${type}; charset=utf-8\", {reinterpret_cast<const char*>(bytes${n}), sizeof bytes${n}}},\n")
    math(EXPR n "${n} + 1")
endforeach()
string(SHA256 version "${contents}")
file(WRITE ${OUT} "#include \"node/web/assets.hpp\"

namespace tactiled::web {
namespace {
${arrays}}  // namespace

std::span<const Asset> assets() {
    static const Asset all[] = {
${entries}    };
    return all;
}

std::string_view assets_version() { return \"${version}\"; }

}  // namespace tactiled::web
")
