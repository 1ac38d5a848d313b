#include "mmbvh.h"
