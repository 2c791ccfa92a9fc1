# cmake -DBINARY=fuzzer -DCORPUS=folder -DWORK=folder -DMAX_LEN=bytes -P run_fuzzer.cmake
# A bounded run over a copy of the corpus; what crashes it stays in WORK.
file(REMOVE_RECURSE ${WORK})
file(MAKE_DIRECTORY ${WORK})
file(GLOB inputs ${CORPUS}/*)
list(FILTER inputs EXCLUDE REGEX "README")
if(NOT inputs)
  message(FATAL_ERROR "no corpus in ${CORPUS}")
endif()
file(COPY ${inputs} DESTINATION ${WORK}/inputs)
execute_process(
  COMMAND ${BINARY} -seed=1 -runs=20000 -max_total_time=30 -max_len=${MAX_LEN} -timeout=10
          -rss_limit_mb=2048 -artifact_prefix=${WORK}/ ${WORK}/inputs
  RESULT_VARIABLE result)
if(NOT result EQUAL 0)
  message(FATAL_ERROR "the fuzzer found something: see ${WORK}")
endif()
