/* SPDX-License-Identifier: MIT OR Apache-2.0 */
/* What the compiler cannot know, so that a program carries what firmware would carry. */
#include <motorlink.h>

static volatile int32_t unknown;
static volatile uint64_t now;
static const void *volatile used;

/* A value that may depend on both. */
static inline int32_t seen(const void *context, int32_t number)
{
    used = context;
    unknown = number;
    return unknown;
}

static inline void use(const void *bytes, size_t size)
{
    seen(bytes, (int32_t)size);
}
