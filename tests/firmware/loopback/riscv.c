/* SPDX-License-Identifier: MIT OR Apache-2.0 */
/* The entry point of a RISC-V with RAM at 0x80000000. */
__asm(".section .vectors, \"ax\"\n"
      ".globl _start\n"
      "_start:\n"
      ".option push\n"
      ".option norelax\n"
      "la gp, __global_pointer$\n"
      ".option pop\n"
      "la sp, stack_top\n"
      "j main\n"
      ".bss\n"
      ".balign 16\n"
      ".skip 16384\n"
      "stack_top:\n");
