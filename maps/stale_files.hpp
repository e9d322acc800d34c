// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

namespace mapcodec {

/// Removes what killed writers left beside `path`: the files `<path>.tmp-<pid>-<n>` whose process is no more
/// and that nobody has locked (a writer in another container or on another machine). What cannot be removed
/// stays; that is no error.
void remove_stale_temporaries(const std::string& path);

}  // namespace mapcodec
