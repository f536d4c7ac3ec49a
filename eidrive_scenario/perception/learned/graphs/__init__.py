"""ONNX models of the networks `yolov5` and `ssd`, made from their weights without torch."""
