// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/e57/e57_pages.hpp"

#include <algorithm>
#include <cstring>

#include "mapcodec/base/crc32c.hpp"

namespace mapcodec {

Status E57Pages::load(std::uint64_t page) const {
  if (page == loaded_) return {};
  loaded_ = UINT64_MAX;
  page_.resize(kPage);
  MAPCODEC_ASSIGN(const std::size_t got, file_.read_at(page * kPage, page_.data(), kPage));
  if (got < kPage) return make_error(ErrorCode::kTruncated, "became shorter while it was read", page * kPage);
  std::uint32_t stored = 0;  // the one number in the file that is big-endian
  for (std::size_t i = 0; i < 4; ++i) stored = stored << 8 | page_[kPayload + i];
  if (crc32c(ByteSpan(page_).first(kPayload)) != stored)
    return make_error(ErrorCode::kMalformed, "has a page of E57 whose checksum does not fit its bytes",
                      page * kPage);
  loaded_ = page;
  return {};
}

Result<std::size_t> E57Pages::read_at(std::uint64_t offset, std::uint8_t* to, std::size_t count) const {
  std::size_t done = 0;
  while (done < count && offset + done < size()) {
    const std::uint64_t at = offset + done;
    MAPCODEC_TRY(load(at / kPayload));
    const auto in_page = static_cast<std::size_t>(at % kPayload);
    const std::size_t n = std::min<std::size_t>(count - done, kPayload - in_page);
    std::memcpy(to + done, page_.data() + in_page, n);
    done += n;
  }
  return done;
}

}  // namespace mapcodec
