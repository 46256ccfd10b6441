// The daemon's part of tactiled/folder.h: the run-time folder, which contains the segment and the control socket.
#pragma once
#include <string>

namespace tactiled {

// Returns the folder that TACTILED_RUNTIME_DIR names; else /run/tactiled if the process may write there (root creates this
// folder); else $XDG_RUNTIME_DIR/tactiled, which is created. setup: throws SetupError where there is no folder, or readers
// would not trust the folder
std::string runtime_folder();

// Sets the folder for every later call of runtime_folder() and every reader of this process. Before the first thread.
void set_runtime_folder(const std::string& folder);

// Returns a warning for the log if the folder works but has a disadvantage, else "".
std::string folder_warning(const std::string& folder, const std::string& node_name);

// Returns the path of the control socket: `configured`, unless that is the default path of another folder than `folder`.
std::string control_in(const std::string& folder, const std::string& node_name, const std::string& configured);

}  // namespace tactiled
