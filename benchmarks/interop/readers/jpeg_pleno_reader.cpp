// JPEG Pleno's reader of PPM: all views by its own rule of names, as 16-bit samples, row after row.
#include <cstdint>
#include <fstream>
#include <iostream>
#include <string>
#include "Lib/Utils/Image/ImageIO.h"
#include "Lib/Part2/Common/PPM3CharViewToFilename.h"

int main(int argc, char **argv) {
  const std::string folder = argv[1];
  const std::size_t columns = std::stoul(argv[2]), rows = std::stoul(argv[3]);
  std::ofstream out(argv[4], std::ios::binary);
  const PPM3CharViewToFilename names;
  for (std::size_t t = 0; t < rows; ++t)
    for (std::size_t s = 0; s < columns; ++s) {
      const auto file = ImageIO::open(folder + "/" + names.view_position_to_filename({t, s}));
      const auto image = ImageIO::read<RGBImage, uint16_t>(*file);
      for (std::size_t y = 0; y < image->get_height(); ++y)
        for (std::size_t x = 0; x < image->get_width(); ++x)
          for (std::size_t c = 0; c < 3; ++c) {
            const uint16_t sample = image->get_channel(c).get_value_at({y, x});
            out.write(reinterpret_cast<const char *>(&sample), sizeof sample);
          }
    }
  return 0;
}
