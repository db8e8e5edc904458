"""The questions that busplan answers, one folder each: the public function, its answer, report and drawing."""
