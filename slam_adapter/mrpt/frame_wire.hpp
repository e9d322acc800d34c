// SPDX-License-Identifier: GPL-3.0-or-later
// Frames as bytes, between the process that reads MRPT's files and the one that wants them. Both are of one
// build: this is no file format. The reader's process may have been led astray by hostile bytes, so nothing
// here is believed either.
#pragma once

#include "mapcodec/base/byte_reader.hpp"
#include "mapcodec/base/decode_limits.hpp"
#include "slam_adapter/mrpt/rawlog_frame.hpp"

namespace mapcodec {

/// Every message: kind (1 byte), length of the payload (4 bytes), payload.
enum class WireKind : std::uint8_t { frame = 1, end = 2, error = 3 };
inline constexpr std::size_t kWireHeader = 5;
inline constexpr std::uint32_t kMaxWirePayload = std::uint32_t{1} << 30;

[[nodiscard]] Bytes write_message(WireKind kind, ByteSpan payload);

[[nodiscard]] Bytes write_frame(const RawlogFrame& frame);
/// Errors: Truncated, Malformed (counts, lengths, poses that are none), LimitExceeded.
[[nodiscard]] Result<RawlogFrame> read_frame(ByteSpan payload);

[[nodiscard]] Bytes write_summary(const RawlogSummary& summary);
[[nodiscard]] Result<RawlogSummary> read_summary(ByteSpan payload);

[[nodiscard]] Bytes write_error(const Error& error);
/// @return the error that was sent, or what is wrong with its bytes.
[[nodiscard]] Error read_error(ByteSpan payload);

}  // namespace mapcodec
