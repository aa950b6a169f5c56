"""Tables of other programs made recordings: whatever file it is, each thing is read right, or refused in one line.

From the file to the recording:

    historian_export                        an export read, from its first byte to the recording
    file_kind                               which kind of file it is, and the tables that it may be
    raw_table                               rows of cells before anything is understood
    text_table                              encodings, separators, quotation marks
    labview_file, line_protocol             LabVIEW's .lvm; InfluxDB's line protocol
    typed_tables                            Excel workbooks, Parquet
    measurement_files                       MATLAB, HDF5, TDMS, MDF4
    matlab_reader, mdf4_reader              MATLAB before 7.3 and MDF4, each in a process of its own
    pandas_store                            data frames in HDF5, by their names
    reader_process                          that process: it may break down or come to no end, and nothing else does
    turned_tables                           a row a signal, a row a value: made a column a signal
    cell_units                              units, by all the names people give them
    export_mapping                          how an export is read, one object; kept in a file for next time
    column_mapping                          `OURS=THEIRS:UNIT`, `--status`
    header_search                           the line that names the columns, and the units about it
    stated_duration                         the unit of its clocks, by the begin and the end above it
    cell_kinds, number_notation             what a cell may be; decimal signs and thousands separators
    sample_rows                             the samples under the header, as cells
    typed_columns                           a column in SI, each cell in its own unit
    clock_groups, column_clock, clock_join  the clock of each column; what it counts; columns of several clocks on one
    time_stamps                             dates and times as seconds
    time_order                              newest first, disorder, repeated rows and hours
    own_format                              whether it is a recording of our own already
    column_names, column_proposal           what columns are called, by language and trade; words that may read them
    control_loop                            whether it is a loop's, OP, PV and SP, and tells of no stem
    loop_reader                             a loop read: time, OP, PV, SP and mode
    column_preview, export_preview          what a file holds, looked at by the code that reads it
    import_questions                        what they leave open, asked
"""
