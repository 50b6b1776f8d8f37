"""One GPU: what a step, a field and a cloud take there, and whether they are what the CPU computes."""
