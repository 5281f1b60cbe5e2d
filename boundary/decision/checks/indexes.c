#include "../parts.h"

static void sift(uint16_t *heap, uint32_t at, uint32_t count, bool (*after)(const void *of, uint16_t one, uint16_t other),
                 const void *of) {
    uint16_t sinking = heap[at];
    for (uint32_t child = 2 * at + 1; child < count; child = 2 * at + 1) {
        if (child + 1 < count && after(of, heap[child + 1], heap[child])) child++;
        if (!after(of, heap[child], sinking)) break;
        heap[at] = heap[child];
        at = child;
    }
    heap[at] = sinking;
}

void rt_sort(uint16_t *numbers, uint32_t count, bool (*after)(const void *of, uint16_t one, uint16_t other), const void *of) {
    for (uint32_t at = count / 2; at-- > 0;) sift(numbers, at, count, after, of);
    for (uint32_t end = count; end-- > 1;) {
        uint16_t last = numbers[0];
        numbers[0] = numbers[end];
        numbers[end] = last;
        sift(numbers, 0, end, after, of);
    }
}
