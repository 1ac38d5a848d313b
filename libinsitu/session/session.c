#include "insitu/insitu.h"
