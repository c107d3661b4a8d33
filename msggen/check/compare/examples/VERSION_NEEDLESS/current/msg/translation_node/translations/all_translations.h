#pragma once

#include "translation_home_position_v1.h"
