#ifndef CDR_READER_HPP
#define CDR_READER_HPP

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>
#include <type_traits>
#include <vector>

namespace cdr {

/// Reads the values of a DDS sample one by one: XCDR1 or plain XCDR2, in either byte order, on any machine.
class Reader {
 public:
  Reader(const std::uint8_t* sample, std::size_t size)
      : good_(size >= 4 && sample[0] == 0 && (sample[1] < 2 || sample[1] / 2 == 3)) {
    if (!good_) return;
    data_ = sample + 4;
    size_ = size - 4;
    little_endian_ = sample[1] % 2 == 1;
    xcdr2_ = sample[1] / 2 == 3;
  }

  /// Returns false after an attempt to read beyond the end of the sample.
  bool good() const { return good_; }
  std::size_t left() const { return size_ - position_; }

  template <class T>
  void number(T& value) {
    const std::size_t alignment = xcdr2_ && sizeof(T) > 4 ? 4 : sizeof(T);
    const std::size_t start = (position_ + alignment - 1) / alignment * alignment;
    good_ = good_ && start + sizeof(T) <= size_;
    if (!good_) return;
    position_ = start + sizeof(T);
    std::uint64_t bits = 0;
    for (std::size_t i = 0; i < sizeof(T); ++i) {
      bits = bits << 8 | data_[start + (little_endian_ ? sizeof(T) - 1 - i : i)];
    }
    if constexpr (std::is_floating_point_v<T>) {
      const auto exact = static_cast<std::conditional_t<sizeof(T) == 4, std::uint32_t, std::uint64_t>>(bits);
      std::memcpy(&value, &exact, sizeof(T));
    } else {
      value = static_cast<T>(bits);
    }
  }

  std::uint32_t length() {
    std::uint32_t value = 0;
    number(value);
    return value;
  }

  void text(std::string& value) {
    const std::size_t size = length();  // includes the NUL
    good_ = good_ && size <= left();
    if (!good_) return;
    value.assign(reinterpret_cast<const char*>(data_ + position_), size > 0 ? size - 1 : 0);
    position_ += size;
  }

  /// Each unit of UTF-16 has four bytes, as ROS 2 writes them.
  void wide_text(std::u16string& value) {
    const std::size_t count = length();
    good_ = good_ && count <= left() / 4;
    value.clear();
    for (std::size_t i = 0; i < count && good_; ++i) value.push_back(static_cast<char16_t>(length()));
  }

  /// Skips the delimiter header, which XCDR2 has before elements that are not numbers.
  template <class T>
  void delimiter() {
    if (xcdr2_ && !std::is_arithmetic_v<T>) length();
  }

 private:
  const std::uint8_t* data_ = nullptr;
  std::size_t size_ = 0;
  std::size_t position_ = 0;
  bool good_;
  bool little_endian_ = true;
  bool xcdr2_ = false;
};

template <class T, class = std::enable_if_t<std::is_arithmetic_v<T>>>
Reader& operator>>(Reader& from, T& value) {
  from.number(value);
  return from;
}

inline Reader& operator>>(Reader& from, std::string& value) {
  from.text(value);
  return from;
}

inline Reader& operator>>(Reader& from, std::u16string& value) {
  from.wide_text(value);
  return from;
}

template <class T, std::size_t N>
Reader& operator>>(Reader& from, std::array<T, N>& values) {
  from.delimiter<T>();
  for (T& value : values) from >> value;
  return from;
}

template <class T>
Reader& operator>>(Reader& from, std::vector<T>& values) {
  from.delimiter<T>();
  values.clear();
  for (std::uint32_t left = from.length(); left > 0 && from.good(); --left) {
    T value{};
    from >> value;
    values.push_back(value);
  }
  return from;
}

/// Reads `message` from a sample with its header. Returns false if bytes are missing, or if more than 3 bytes follow:
/// DDS may add up to 3 bytes of padding.
template <class T>
bool decode(const std::uint8_t* sample, std::size_t size, T& message) {
  Reader from(sample, size);
  from >> message;
  return from.good() && from.left() < 4;
}

}  // namespace cdr

#endif
