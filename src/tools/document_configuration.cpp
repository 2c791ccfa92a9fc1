#include <cstdio>

#include "scanner/pipeline/config.h"

int main() {
  std::fputs(scanner::pipeline::documentConfiguration().c_str(), stdout);
  return 0;
}
