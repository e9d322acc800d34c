// SPDX-License-Identifier: GPL-3.0-or-later
#include <ctime>

#include "maps/service/map_worker.hpp"

namespace mapcodec {

Result<MapEditor*> EditingDesk::editor() {
  if (editor_ != nullptr) return editor_.get();
  if (context_.editors.fetch_add(1) >= context_.settings.max_editors) {
    --context_.editors;
    return make_error(ErrorCode::kBusy, "too many maps are being written to");
  }
  auto opened = context_.coding.edit(path_, nullptr);
  if (!opened.ok()) {
    --context_.editors;
    return opened.error();
  }
  editor_ = std::move(opened).value();
  writers_ = WriterTable::read(editor_->info());
  open_ = true;
  return editor_.get();
}

void EditingDesk::put_away() {
  if (editor_ == nullptr) return;
  editor_ = nullptr;
  --context_.editors;
  open_ = false;
}

Result<EditReport> EditingDesk::commit() {
  const auto report = editor_->commit(std::time(nullptr));
  if (!report.ok()) {
    put_away();
    return report;
  }
  if (report->committed) tell_changed();
  return report;
}

void EditingDesk::tell_changed() {
  reader_.changed();
  watchers_.tell();
}

}  // namespace mapcodec
